# Row 12: a worker of a sweep is killed, as a system without memory does: the rows so far are kept,
# and the circle tests that are done, if any.
# exits: 2
# says: a worker was killed \(out of memory\?\)
# says: kept in c\.partial\.csv
busplan sweep p.toml --vary circle.radius_mm=640 --vary servo.position_gain_per_s=100:139 --circle --jobs 2 -o c.csv &
sweep=$!
until test "$(wc -w < "/proc/$sweep/task/$sweep/children")" -eq 3; do sleep 0.05; done
set -- $(cat "/proc/$sweep/task/$sweep/children")
kill -KILL "$3"
wait "$sweep"
code=$?
test "$(ls | grep -v '^c\.csv\.parts$')" = "$(printf 'c.partial.csv\np.toml')" && exit $code
