# Row 8: documents are UTF-8 whatever the locale; a table keeps to the terminal's encoding.
# exits: 0
sed -i 's/^name = .*/name = "Fräse"/' p.toml
export PYTHONIOENCODING=cp1252
busplan check - --stdin-filename größe.toml --no-circle --format junit < p.toml > x.xml
busplan report p.toml --no-circle > x.html
busplan capacity p.toml --format json > x.json
grep -q größe x.xml && grep -q Fräse x.html && grep -q 'Fr\\u00e4se\|Fräse' x.json || exit 1
iconv -f UTF-8 -t UTF-8 x.xml x.html x.json > /dev/null || exit 1
PYTHONIOENCODING=ascii busplan capacity p.toml | grep -q 'Fr\\u00e4se'
