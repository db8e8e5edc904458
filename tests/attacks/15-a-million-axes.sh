# A node with a million axes: a list of all frames, or of all payloads, would take more than the memory there is.
# exits: 1
# says: ^$
ulimit -v 3000000
ulimit -t 20
cat > axes.toml <<'TOML'
schema_version = 1
name = "axes"
[bus]
kind = "sercos2"
data_rate_mbit_s = 16
at_gap_us = 1e9
nodes = 19
[cycle]
period_us = 1000
slice_ratio = 1
[payload]
read_bytes_per_axis = 1000000
write_bytes_per_axis = 31
[node]
axes = 1000000
[node.execution]
kind = "linear"
base_us = 20
per_byte_us = 0.1
worst_extra_us = 1e9
TOML
busplan compare axes.toml > compared.txt && grep -q "shown to fit on none" compared.txt || exit 3
busplan plan axes.toml --free period,payload,nodes > planned.txt
