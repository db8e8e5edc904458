# Row 5: the baseline is a pipe that nobody writes, or has no end.
# exits: 2
# says: pipe: is a named pipe; give a regular file
# says: /dev/zero: is larger than 32,000,000 bytes, so it is not a baseline
mkfifo pipe
timeout 10 busplan check p.toml --no-circle --baseline pipe
test $? = 2 && (ulimit -v 4000000; timeout 10 busplan check p.toml --no-circle --baseline /dev/zero)
