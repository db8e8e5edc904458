# Row 6: the name of a file holds an escape sequence, a C1 control, a DEL and a mark that turns text around.
# exits: 0
name=$'p\e[2J\xc2\x9b2J\x7f\xe2\x80\xae.toml'
mv p.toml "$name"
busplan check "$name" --format json >check.json || exit
busplan diff "$name" paper-4ms --format json >diff.json || exit
busplan diff "$name" paper-4ms --format markdown >diff.md || exit
# Every byte of these documents is plain: what else the name holds is escaped.
! LC_ALL=C grep -lP '[^\n\t -~]' check.json diff.json diff.md >&2 && grep -q 'u009b2J' check.json
