# Row 14: a working folder that somebody removed.
# exits: 2
# says: ^the working folder no longer exists; change into one that does$
mkdir gone && cd gone && rmdir ../gone
busplan init x
