# Row 13: another form of the execution time has other keys, and one that goes has a comment.
# exits: 0
# says: every comment of yours is kept
sed -i 's/^payload_bytes = .*/&  # measured by Li/' p.toml
busplan calibrate p.toml table-1.csv --form linear --apply >fit.txt && grep -qx '# measured by Li' p.toml
