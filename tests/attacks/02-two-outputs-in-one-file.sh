# Row 2: the answer and its trace, by two names of one file that is not there yet.
# exits: 2
# says: --output a\.csv and --trace b\.csv: the same file
ln -s a.csv b.csv
busplan circle-test p.toml -o a.csv --trace b.csv
code=$?
test ! -e a.csv && exit $code
