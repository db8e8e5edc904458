# Row 1: the help and the version on a full disk.
# exits: 2
# says: standard output cannot be written: No space left on device
PYTHONUNBUFFERED=1 busplan --version > /dev/full
test $? -eq 2 && busplan sweep --help > /dev/full
