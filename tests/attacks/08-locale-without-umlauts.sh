# Row 8: documents are UTF-8 whatever the locale; a table keeps to the terminal's encoding.
# exits: 0
sed -i 's/^name = .*/name = "Fräse"/' p.toml
export PYTHONIOENCODING=cp1252
busplan check - --stdin-filename größe.toml --no-circle --format junit < p.toml > x.xml
grep -q größe x.xml && iconv -f UTF-8 -t UTF-8 x.xml > /dev/null || exit 1
PYTHONIOENCODING=ascii busplan capacity p.toml | grep -q 'Fr\\u00e4se'
