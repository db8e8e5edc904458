# Row 2: a report over the record that the same call updates.
# exits: 2
# says: --output b\.json and --baseline b\.json: the same file
busplan check p.toml --no-circle --baseline b.json --update-baseline -q || exit 1
cp b.json before
busplan check p.toml --no-circle --baseline b.json --update-baseline -o b.json
code=$?
cmp b.json before && exit $code
