# Row 14: a working folder that somebody removed.
# exits: 2
# says: ^the working folder is no longer there; change into one that is$
mkdir gone && cd gone && rmdir ../gone
busplan init x
