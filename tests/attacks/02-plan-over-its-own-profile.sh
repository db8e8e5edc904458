# Row 2: the plan's new profile would destroy the one it was made from, comments and all.
# exits: 2
# says: p\.toml
cp p.toml before
ln -s p.toml link.toml
busplan plan p.toml -o link.toml --force
code=$?
cmp p.toml before && exit $code
