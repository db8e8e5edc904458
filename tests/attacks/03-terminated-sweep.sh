# Row 3: SIGTERM to a sweep with workers: they end, the rows so far stay, and nothing else does.
# exits: 143
# says: interrupted after \d+ of 40 points; kept in c\.partial\.csv
busplan sweep p.toml --vary circle.radius_mm=640 --vary servo.position_gain_per_s=100:139 --circle --jobs 2 -o c.csv &
until workers=$(< "/proc/$!/task/$!/children") && test "$(wc -w <<< "$workers")" -eq 3; do sleep 0.05; done
kill -TERM $!
wait $!
code=$?
for one in $workers; do
    for _ in 1 2 3 4 5 6; do grep -sq 'State:.[^Z]' "/proc/$one/status" && sleep 0.1; done
    ! grep -sq 'State:.[^Z]' "/proc/$one/status" || exit 1
done
test "$(ls -A)" = "$(printf 'c.partial.csv\np.toml')" && exit $code
