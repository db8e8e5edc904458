# Row 3: SIGKILL to a sweep with workers: their common standard output ends, and no temporary file stays.
# exits: 0
sweep() {
    busplan sweep p.toml --vary circle.radius_mm=640 --vary servo.position_gain_per_s=100:139 --circle --jobs 2 -o c.csv &
    until test "$(wc -w < "/proc/$!/task/$!/children")" -eq 3; do sleep 0.05; done
    kill -KILL $!
}
timeout 10 cat < <(sweep 2> said) || exit 1
test "$(ls -A)" = "$(printf 'p.toml\nsaid')"
