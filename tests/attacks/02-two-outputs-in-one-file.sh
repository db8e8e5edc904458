# Row 2: rows and their figure, by two names of one file that is not there yet.
# exits: 2
# says: --output a\.svg and --plot b\.svg: the same file
ln -s a.svg b.svg
busplan sweep p.toml --vary bus.nodes=1:3 --format csv -o a.svg --plot b.svg
code=$?
test ! -e a.svg && exit $code
