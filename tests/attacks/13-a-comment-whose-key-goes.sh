# Row 13: another form of the execution time has other keys, and one that goes has a comment.
# exits: 0
# says: your comments are kept
sed -i 's/^kind = "table".*/kind = "linear"/; s/^payload_bytes = .*/base_us = 30  # least T_exec/; s/^time_us = .*/per_byte_us = 0.3/' p.toml
busplan calibrate p.toml table-1.csv --apply >fit.txt && grep -qx '# least T_exec' p.toml
