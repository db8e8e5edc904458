# Row 2: the report would destroy the profile it reports on.
# exits: 2
# says: p\.toml
cp p.toml before
busplan check p.toml --no-circle -o p.toml
code=$?
cmp p.toml before && exit $code
