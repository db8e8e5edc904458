# Row 10: the name of a profile is a formula.
# exits: 0
sed -i "s/^name = .*/name = \"=cmd|' \/C calc'!A0\"/" p.toml
busplan capacity p.toml --format csv >rows.csv && tail -n 1 rows.csv | grep -q "^'=cmd|"
