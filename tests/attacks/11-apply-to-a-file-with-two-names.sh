# Row 11: a new file would part the names of the old one, or take the place of one that is read-only.
# exits: 2
# says: p\.toml: has 2 hard links
# says: q\.toml: is read-only \(mode 0444\)
ln p.toml r.toml
busplan plan p.toml --nodes 4 --apply
test $? = 2 && cmp p.toml r.toml && test p.toml -ef r.toml || exit 1
cp p.toml q.toml && chmod 444 q.toml
busplan plan q.toml --nodes 4 --apply
code=$?
cmp p.toml q.toml && exit $code
