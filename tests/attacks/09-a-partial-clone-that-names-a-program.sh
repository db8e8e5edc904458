# Row 9: a partial clone allows itself a protocol that is a program, and git fetches what is missing by itself.
# exits: 2
# says: git says: .*(not allowed|lazy fetching disabled)
export GIT_CONFIG_GLOBAL=/dev/null GIT_CONFIG_NOSYSTEM=1
git init --quiet there
mv p.toml there
git -C there add p.toml
git -C there -c user.name=n -c user.email=e commit --quiet --message m
git -C there config uploadpack.allowFilter true
git clone --quiet --no-checkout --filter=blob:none "file://$PWD/there" here
git -C here config remote.origin.url "ext::touch $PWD/owned"
git -C here config protocol.ext.allow always
# A git that does not know the variable.
mkdir bin
printf '#!/bin/sh\nunset GIT_NO_LAZY_FETCH\nexec %s "$@"\n' "$(command -v git)" >bin/git
chmod +x bin/git
cd here
PATH="$OLDPWD/bin:$PATH" busplan diff HEAD:p.toml paper-4ms
code=$?
test ! -e ../owned && exit $code
