# Row 14: -o - is standard output, and no file called -.
# exits: 0
busplan plan p.toml --no-circle -o - | busplan check - -o - --format json --no-circle > found.json
grep -q '"checked": 1\|"files"' found.json && test ! -e ./-
