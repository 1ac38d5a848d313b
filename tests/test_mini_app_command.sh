#!/bin/sh
# The mini-app as a command: wrong options end all of 3 ranks, and one rank, with status 1 and one message; an error of
# libinsitu does not end it. usage: test_mini_app_command.sh INSITU_WAVE MPIEXEC [MPIEXEC_ARGUMENT...]
set -u
wave=$1
shift
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 1
failed=0

# expect STATUS TEXT ARGUMENT...: the status of a run, and a text on one line of what it prints; prints TEXT: another text
# of the same run
expect() {
    status=$1 text=$2
    shift 2
    "$@" >out.txt 2>&1
    got=$?
    prints "$text" "$@"
}
prints() {
    text=$1
    shift
    lines=$(grep -c -- "$text" out.txt)
    if [ $got -ne "$status" ] || [ "$lines" -ne 1 ]; then
        echo "status $got, wanted $status; $lines lines with: $text; of $*"
        cat out.txt
        failed=1
    fi
}
small="--size 4 --steps 3"

expect 1 "expected tet|hex|wedge|pyramid|mixed, got cube" "$@" "$wave" --cells cube
expect 1 "--size: expected .* got 0" "$wave" --size 0
expect 1 "--size: expected .* got 4,5" "$wave" --size 4,5
expect 1 "--steps: expected .* got nothing" "$wave" --steps
expect 1 "--jitter: expected .* got nan" "$wave" --jitter nan
expect 1 "--speed: no such option" "$wave" --speed 3
expect 1 "insitu-wave: -x: no such option" "$wave" -xy
expect 1 "insitu-wave: tet: no such option" "$wave" --steps 1 tet
expect 1 "--ghosts takes no value" "$wave" --ghosts=1
expect 0 "mpirun -n 4 insitu-wave" "$@" "$wave" --help
expect 0 "^simulated in" "$@" "$wave" $small --no-insitu --size=1,2,1 --partition random --cells mixed
expect 0 "^simulated in" "$@" "$wave" $small --no-insitu --moving --boundary reflect --centring vertex --order 1
expect 0 "rank 0: no pictures: .*missing.yaml" "$@" "$wave" $small --scene missing.yaml
prints "^no pictures"
cat >scene.yaml <<'END'
images:
  - name: fronts
    layers: [{isosurface: {field: no_such_field, values: [0.1]}}]
    outputs: [{path: "{name}_{cycle}.png"}]
END
expect 0 "^ *3 .*|" "$@" "$wave" $small --scene scene.yaml
prints "rank 0: in situ step: .*no_such_field"
exit $failed
