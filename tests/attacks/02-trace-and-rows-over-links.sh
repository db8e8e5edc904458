# Row 2: a trace and rows through a symbolic and a hard link, and standard input by its name.
# exits: 2
# says: --trace link\.csv: would overwrite p\.toml
# says: --output twin\.csv: would overwrite standard input
cp p.toml before
ln -s p.toml link.csv
ln p.toml twin.csv
busplan circle-test p.toml --trace link.csv && exit 1
busplan sweep - --vary bus.nodes=1:3 -o twin.csv < p.toml
code=$?
cmp p.toml before && exit $code
