# Row 7: a pull request adds a file that would switch the gate off, and a folder called like a shipped profile.
# exits: 1
# says: checked 2 profiles: 2 errors
# What the action's last step runs: the lines of its last `run: |`.
sed -n '/name: Check/,$ { /run: |/,$ s/^        //p }' "$(dirname "$0")/../../action.yml" >run.sh
mkdir -p bin/busplan/bin work/paper-1ms
ln -s "$(command -v busplan)" bin/busplan/bin/busplan
sed -i 's/^period_us = .*/period_us = 100/' p.toml
cp p.toml work/--exit-zero
mv p.toml work/paper-1ms/p.toml
cd work
RUNNER_TEMP=../bin PATHS='--exit-zero paper-1ms' ARGS=--no-circle bash -e ../run.sh
