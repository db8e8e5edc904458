# Row 13: another form of the execution time has other keys, and one that goes has a comment.
# exits: 0
# says: your comments are kept
sed -i 's/^payload_bytes = .*/&  # least T_exec/' p.toml
busplan calibrate p.toml table-1.csv --form linear --apply >fit.txt && grep -qx '# least T_exec' p.toml
