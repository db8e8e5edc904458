# Row 4: four runs record a profile each in the same baseline, at once.
# exits: 0
for name in a b c d; do
    cp p.toml "$name.toml"
    busplan check "$name.toml" --no-circle --quiet --baseline base.json --update-baseline &
done
wait
# The figures and the keys of each.
grep -c '"[abcd].toml"' base.json | grep -qx 8
