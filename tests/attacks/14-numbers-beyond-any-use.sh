# Row 14: numbers that messages made others of.
# exits: 2
# says: --from 1e308s: is too long
# says: bus.nodes 99999999999999999999999: must be
# says: payload.read_bytes 24.408
busplan timeline p.toml --from 1e308s
busplan sweep p.toml --vary bus.nodes=99999999999999999999999
busplan sweep p.toml --vary payload.read_bytes=4:1004:#50
