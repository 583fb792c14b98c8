#!/bin/sh
# The renderer, examples/render.c, as its users meet it: wrong command lines, files that cannot be written, shards,
# checkpoints, kills, models, comparisons.
#
#   sh tests/check_tool.sh        in the project's top directory; CC, CFLAGS and EXTRA are respected
#
# RENDER names a renderer that is built already. LONG=1 kills it 20 times instead of 3. Pictures are small: the
# numbers that a render must get right are looked at by the test programs.

set -u
CC=${CC:-cc}
CFLAGS=${CFLAGS:--O2}
EXTRA=${EXTRA:-}
top=$(pwd)
dir=$top/build/check_tool
passed=0
failed=0

rm -rf "$dir"
mkdir -p "$dir" || exit 1
render=$top/${RENDER:-build/check_tool/render}
# shellcheck disable=SC2086
[ -n "${RENDER:-}" ] || $CC $CFLAGS $EXTRA -std=c99 -ffp-contract=off -I. examples/render.c -o "$render" -lm -pthread ||
    { echo 'check_tool: 0 passed, 1 failed'; exit 1; }
cd "$dir" || exit 1

check() # STATUS LABEL: counts it
{
    if [ "$1" = 0 ]; then
        passed=$((passed + 1))
        echo "ok     $2"
    else
        failed=$((failed + 1))
        echo "FAIL   $2"
    fi
}

quiet() # ARGUMENT...: the renderer with its output going to files
{
    "$render" "$@" > out 2> err
}

same_files() # LABEL FILE FILE
{
    cmp "$2" "$3" > cmp.out 2>&1
    check $? "$1"
    cat cmp.out
}

# A value of the report of --compare: what stands after the word.
compared() # WORD
{
    awk -v word="$1" '$1 == word { print $2; exit }' out
}

# A PNG that has its signature and its end?
is_png()
{
    [ "$(head -c 4 "$1" 2> /dev/null | tail -c 3)" = PNG ] && tail -c 8 "$1" | grep -q IEND
}

# ---- the command line ----------------------------------------------------------------------------

quiet --help
check $? '--help succeeds'
[ "$(awk 'length($0) > 80 { bad = 1 } END { print (NR <= 40 && NR > 20 && !bad) }' out)" = 1 ]
check $? "--help fits 40 lines of 80 columns: $(wc -l < out | tr -d ' ')"
missing=
for option in $(sed -n 's/^    {"\(-[a-z-]*\)", set_.*/\1/p' "$top/examples/render/options.h"); do
    grep -q -e " $option[ ,.)]" -e " $option\$" out || [ "$option" = --help ] || [ "$option" = -h ] || missing="$missing $option"
done
[ -z "$missing" ]
check $? "--help names every option$missing"
quiet --list && grep -q '^  cornell ' out && grep -q '^  path ' out && grep -q '^  sobol$' out
check $? '--list names scenes, methods and samplers'

# What is wrong is named in one line on stderr, nothing is printed or written, and the status is 2.
wrong() # WORD ARGUMENT...
{
    word=$1
    shift
    quiet "$@"
    status=$?
    [ $status = 2 ] && [ ! -s out ] && [ "$(wc -l < err | tr -d ' ')" = 1 ] && grep -q '^render: ' err && grep -qF -e "$word" err
    check $? "wrong: render $*: $(cat err)"
}

touch here.film
wrong --spps cornell --spps 3
wrong 'must be in 1' --spp 0
wrong 'must be in 1' --spp -1
wrong 'must be in 1' --spp=4294967295
wrong 'needs a value' cornell --spp
wrong 'takes no value' --floor=3
wrong 640x480 --size 0x4
wrong 640x480 --size 12
wrong 640x480 --size 3x4x5
wrong .png -o picture.jpg
wrong .png -o ''
wrong 'above 0' --seconds 0
wrong 'above 0' --seconds nan
wrong 'above 0' --error 1e400
wrong 'seconds above 0' --every 0x10 --checkpoint k
wrong 'path, path-light' --method pathh
wrong 'sobol, independent' --sampler halton
wrong 'box, tent' --filter bax
wrong 'p6-16' --ppm p7
wrong 'X,Y,Z' --eye 1,2
wrong 'X,Y,Z' --up 1,2,3,4
wrong 'X,Y,Z' --look-at 1,b,3
wrong degrees --fov 180
wrong 'R,G,B' m.obj --sky -1
wrong 'cornell-empty' cornel
wrong 'one scene' cornell furnace
wrong 'max-edges' --roulette none
wrong 'probability' --roulette 1.5
wrong 'known number' --sampler stratified --seconds 1
wrong 'not with' --sampler stratified --shard 1/2
wrong 'I/N' --shard 0/4
wrong 'I/N' --shard 5/4
wrong 'more --spp' --shard 1/80
wrong 'needs --spp' --shard 1/2 --seconds 3
wrong 'needs --checkpoint' --resume
wrong 'needs --checkpoint' --every 3
wrong 'is for a model' cornell --floor
wrong 'with --merge' --merge here.film --spp 3
wrong 'with --compare' --compare here.film here.film -o a.png
wrong 'two pictures' --compare here.film
wrong 'names of films' --merge
wrong 'not together' --merge --compare here.film here.film
wrong 'parenthesis' --only 'L(D'
wrong 'tell paths apart' --only LDE --method whitted
wrong 'not with --only' --only LDE --error-map e.png
rm -f here.film

# What cannot be done is one line as well, and the status is 1.
fails() # WORD ARGUMENT...
{
    word=$1
    shift
    quiet --progress off "$@"
    status=$?
    [ $status = 1 ] && [ "$(grep -c '^render: ' err)" -ge 1 ] && grep -qF -e "$word" err
    check $? "fails: render $*: $(tail -n 1 err)"
}

fails "'nowhere/a.png'" furnace -o nowhere/a.png
mkdir directory
fails 'no regular file' furnace --csv directory
fails none.obj none.obj
fails none.pfm furnace --reference none.pfm --size 8x8
fails 'no such camera' furnace --eye 0,0,0 --look-at 0,0,0 --size 8x8 --spp 1
quiet furnace --size 8x8 --spp 2 --progress off -o f.png -o f.pfm --film f.film
check $? 'a picture as .png, .pfm and film'
[ -z "$(ls ./*.part ./cornell* 2> /dev/null)" ]
check $? 'nothing was written that was not asked for'

# ---- pictures ------------------------------------------------------------------------------------

quiet cornell-spheres --size 40x30 --spp 16 --progress off -o c.png -o c.ppm -o c.pfm --film c.film \
    --albedo a.pfm --normal n.png --depth d.ppm --error-map e.pfm --csv c.csv --svg c.svg
check $? 'all kinds of output'
is_png c.png && is_png n.png && [ "$(head -c 12 c.ppm | tr '\n' ' ')" = 'P6 40 30 255' ] && grep -q '<svg' c.svg
check $? 'they are what their names say'
[ "$(tail -n 1 c.csv | cut -d , -f 1-6)" = "path,sobol,40,30,$(tail -n 1 c.csv | cut -d , -f 5),16" ]
check $? 'the table as CSV ends with the last sample count'
estimated=$(tail -n 1 c.csv | cut -d , -f 11)

# The mean square of the error picture over all values is the estimated relMSE of the table: compare it with black.
{ printf 'PF\n40 30\n-1.0\n'; dd if=/dev/zero bs=12 count=1200 2> /dev/null; } > black.pfm
quiet --compare e.pfm black.pfm
shown=$(compared RMSE)
awk -v a="$shown" -v b="$estimated" 'BEGIN { exit !(b > 0 && a * a / b > 0.99999 && a * a / b < 1.00001) }'
check $? "the mean square of --error-map is the estimated relMSE: $shown^2, $estimated"

for kind in p6 p6-16 p3 p3-16; do
    quiet --merge c.film -o $kind.ppm --ppm $kind
    status=$?
    case $kind in
    p6) want='P6 40 30 255' ;;
    p6-16) want='P6 40 30 65535' ;;
    p3) want='P3 40 30 255' ;;
    p3-16) want='P3 40 30 65535' ;;
    esac
    [ $status = 0 ] && [ "$(head -n 3 $kind.ppm 2> /dev/null | tr '\n' ' ' | tr -s ' ' | sed 's/ $//')" = "$want" ]
    check $? "--ppm $kind begins with $want"
done
same_files 'a film keeps the picture' p6.ppm c.ppm

quiet --compare c.film c.film && [ "$(compared RMSE)" = 0 ] && [ "$(compared relMSE)" = 0 ] && [ "$(compared largest)" = 0 ]
check $? 'a film compared with itself: 0'
for other in c.pfm c.png p6-16.ppm; do
    quiet --compare $other $other && [ "$(compared RMSE)" = 0 ] && [ "$(compared relMSE)" = 0 ] && grep -q 'no variance' out
    check $? "$other compared with itself: 0, and z is not known"
done
# 8 bits in sRGB are off by half a step at most, which is steepest at white: 0.5/255 * 2.4/1.055.
quiet --compare p6-16.ppm c.png
awk -v d="$(compared RMSE)" 'BEGIN { exit !(d > 0 && d < 0.5 / 255 * 2.28) }'
check $? "16 bits against 8 bits: RMSE $(compared RMSE)"
# z of blocks: of size 1 for other random numbers, and far off where light is missing.
z_of() # FIELD: rms or worst
{
    sed -n "s/.* $1 \\([-+0-9.e]*\\).*/\\1/p" out
}
for seed in 1 2; do quiet cornell --size 64x64 --spp 8 --progress off --seed $seed --film z$seed.film; done
quiet --compare z1.film z2.film
awk -v r="$(z_of rms)" -v z="$(z_of worst)" 'BEGIN { exit !(r > 0.5 && r < 1.5 && z < 5 && z > -5) }'
check $? "other random numbers differ by their noise: z of blocks, rms $(z_of rms), worst $(z_of worst)"
quiet cornell --size 64x64 --spp 8 --progress off --max-edges 2 --film short.film && quiet --compare short.film z1.film
awk -v z="$(z_of worst)" 'BEGIN { exit !(z < -5) }'
check $? "direct light only is too dark, and blocks show it: worst z $(z_of worst)"
quiet --compare z1.film z1.film && grep -q 'may share samples' out
check $? 'films of the same samples: a line says that z is too small'
quiet cornell-spheres --size 40x30 --spp 16 --reference c.pfm --progress off -o r.png && grep -q 'true RMSE' out &&
    awk '$1 == 16 { exit !($(NF - 1) < 1e-6) }' out
check $? 'against itself as the reference the true error is the rounding to float'
fails '40 x 30' cornell --size 8x8 --reference c.pfm
fails '8 x 8' --compare f.film c.film

# Emission alone, 1 everywhere: exposure 1/4 gives the sRGB byte of 1/4, 137.
bytes_of() # PPM of 8 x 8 pixels: the values that occur
{
    tail -c 192 "$1" | od -An -v -t u1 | tr -s ' \n' '\n\n' | sort -u | tr '\n' ' ' | sed 's/^ *//; s/ *$//'
}
quiet furnace --size 8x8 --spp 2 --max-edges 1 --exposure 0.25 --progress off -o x.ppm
[ "$(bytes_of x.ppm)" = 137 ]
check $? "--exposure is a factor of the brightness: $(bytes_of x.ppm)"
quiet furnace --size 8x8 --spp 2 --only LE --exposure 0.25 --progress off -o x.ppm
[ "$(bytes_of x.ppm)" = 137 ]
check $? "--only LE is the emission that the eye sees: $(bytes_of x.ppm)"

# Budgets, and where each ends. That of the error ends at a doubling, and so always at the same one.
for budget in '--seconds 0.2:seconds' '--cpu-seconds 0.2:CPU seconds' '--error 0.3:error'; do
    # shellcheck disable=SC2086
    quiet cornell --size 24x24 --progress off -o b.png ${budget%:*}
    grep -q "^stopped by ${budget#*:} at" out
    check $? "${budget%:*}: $(grep '^stopped by' out)"
done
spp=$(sed -n 's/^stopped by error at \([0-9]*\) .*/\1/p' out)
awk -v n="$spp" 'BEGIN { while (n > 1 && n % 2 == 0) n /= 2; exit n != 1 }'
check $? "an error budget ends at a doubling: $spp"
awk -v n="$spp" '$1 == n { now = $6 } $1 == n / 2 { before = $6 } END { exit !(now < 0.09 && before >= 0.09) }' out
check $? 'the first one whose estimated relMSE is below 0.3^2'
# Also where checkpoints cut the render into small steps.
quiet cornell --size 60x45 --error 0.1 --checkpoint e --every 0.02 --progress off -o b.png
spp=$(sed -n 's/^stopped by error at \([0-9]*\) .*/\1/p' out)
awk -v n="$spp" 'BEGIN { while (n > 1 && n % 2 == 0) n /= 2; exit n != 1 }'
check $? "in small steps too: $spp"
awk '$1 + 0 == $1 && NF == 7 { if ($1 != (n ? 2 * n : 1)) bad = 1; n = $1 } END { exit bad || n < 16 }' out
check $? 'the table has a row for each doubling, and no other'
quiet cornell --size 24x24 --spp 9 --seconds 1000 --progress off -o b.png && grep -q '^stopped by samples at 9 ' out
check $? 'samples and seconds: whichever is first'

# Nobody reads stdout and stderr to the end: the pictures are written all the same.
"$render" furnace --size 8x8 --spp 4 --progress off -o pipe.png 2>&1 | :
is_png pipe.png
check $? 'a closed pipe loses no picture'

# ---- shards --------------------------------------------------------------------------------------

quiet cornell-spheres --size 40x30 --spp 17 --progress off --depth z.png --only 'L.*DE' --film whole.film -o whole.png
for k in 1 2 3; do
    quiet cornell-spheres --size 40x30 --spp 17 --progress off --depth z.png --only 'L.*DE' --shard $k/3
    check $? "shard $k of 3: $(sed -n 's/^stopped by //p' out)"
done
quiet --merge cornell-spheres-2-of-3.film cornell-spheres-1-of-3.film cornell-spheres-3-of-3.film --film merged.film -o merged.png
check $? "merge: $(cat out)"
quiet --compare merged.film whole.film
awk -v d="$(compared largest)" 'BEGIN { exit !(d < 1e-12) }'
check $? "three shards merged are the whole within 1e-12: $(compared largest)"
same_files 'and the same picture of the paths asked for' merged.png whole.png
fails 'has samples that' --merge whole.film cornell-spheres-1-of-3.film -o no.png
fails 'not the same picture' --merge z1.film short.film -o no.png
fails 'its size differs' --merge c.film f.film -o no.png
fails 'is a picture' --merge c.film c.png -o no.png
[ ! -e no.png ]
check $? 'what cannot be merged is not written'

# ---- checkpoints ---------------------------------------------------------------------------------

long='cornell --size 60x45 --progress off --threads 1'
quiet $long --spp 160 --film undisturbed.film
check $? 'a render without checkpoints'

# The file is there, within a minute.
wait_for()
{
    tries=0
    while [ ! -e "$1" ] && [ $tries -lt 600 ]; do
        sleep 0.1
        tries=$((tries + 1))
    done
}

# SIGTERM: the passes that are finished are kept, in the checkpoint too.
"$render" $long --seconds 20 --checkpoint t --every 0.05 -o t.png > out 2> err &
process=$!
wait_for t
kill -TERM $process
wait $process
status=$?
[ $status = 143 ] && is_png t.png && grep -q 'interrupted; kept' err && grep -q 'stopped by a signal' out
check $? "SIGTERM: status 143, and the picture is there: $(tail -n 1 err)"
fails 'this checkpoint exists' $long --checkpoint t

# ... also between steps that are shorter than the renderer asks, and within one that is long. (Both would end by
# themselves.)
"$render" furnace --size 8x8 --progress off --spp 100000000 --seconds 20 --checkpoint u --every 0.01 -o u.png > out 2> err &
process=$!
wait_for u
kill -TERM $process
wait $process
status=$?
[ $status = 143 ] && grep -q 'stopped by a signal' out
check $? "SIGTERM between short steps: $(tail -n 1 err)"
"$render" $long --spp 3000 --sampler stratified -o v.png > out 2> err &
process=$!
sleep 1
kill -TERM $process
wait $process
status=$?
[ $status = 143 ] && grep -q 'interrupted' err && ! grep -q ' 3000 samples' err
check $? "SIGTERM within a long step: $(tail -n 1 err)"

quiet $long --checkpoint t --resume --spp 4 -o t.png && grep -q 'resumed from' err
check $? "a checkpoint beyond the budget is written as it is: $(head -n 1 err)"
fails 'of another picture' $long --checkpoint t --resume --spp 4 --seed 1

# SIGKILL at moments drawn by lot, again and again, each time resumed; where a render gets to its end, the next one
# begins anew. The end is the same bits.
kills=3
[ -z "${LONG:-}" ] || kills=20
delays=$(awk -v n=$kills 'BEGIN { srand(7); for (i = 0; i < n; i++) printf "%.3f ", 0.02 + 0.4 * rand() }')
killed=0
ends=0
bad=
for delay in $delays; do
    "$render" $long --spp 160 --checkpoint k --every 0.05 --resume --film k.film > out 2> err &
    process=$!
    sleep "$delay"
    kill -KILL $process 2> /dev/null
    wait $process 2> /dev/null
    status=$?
    if [ $status = 137 ]; then
        killed=$((killed + 1))
        # whatever was there before is there still: a whole film, under one of two names, if any was begun
        if [ -e k ] || [ -e k.1 ]; then
            if [ -e k ]; then newest=k; else newest=k.1; fi
            quiet --merge $newest --film whole_k.film || bad="$bad $newest after kill $killed;"
        fi
    elif [ $status = 0 ]; then
        ends=$((ends + 1))
        cmp -s k.film undisturbed.film || bad="$bad other bits at end $ends;"
        rm -f k k.1
    else
        bad="$bad status $status;"
    fi
done
[ -z "$bad" ]
check $? "killed $killed times and $ends times not: a whole checkpoint is there at any time:$bad"
quiet $long --spp 160 --checkpoint k --every 0.05 --resume --film k.film
check $? "resumed to the end: $(head -n 1 err)"
same_files 'the same bits as undisturbed' k.film undisturbed.film

# In two steps, without any luck: the checkpoint of 70 samples and what comes after it.
rm -f k k.1 k.film
quiet $long --spp 70 --checkpoint k && cp k first_k
fails "'k': this checkpoint exists" $long --spp 160 --checkpoint k
same_files 'which is left as it was' k first_k
quiet $long --spp 160 --checkpoint k --resume --film k.film &&
    grep -q "resumed from 'k' at 70 samples" err
check $? 'a render to 70 samples goes on to 160'
awk '$1 == 160 { exit $NF != "unknown" }' out
check $? 'its efficiency is unknown: the time before is'
same_files 'the same bits' k.film undisturbed.film
[ -s k.1 ]
check $? 'the checkpoint before is kept'

# The newest one is damaged: one byte in its middle, then half of it missing.
cp k whole_k
for harm in byte half; do
    size=$(wc -c < whole_k)
    if [ $harm = byte ]; then
        { head -c $((size / 2)) whole_k; printf 'x'; tail -c $((size - size / 2 - 1)) whole_k; } > k
        cmp -s k whole_k && { head -c $((size / 2)) whole_k; printf 'y'; tail -c $((size - size / 2 - 1)) whole_k; } > k
    else
        head -c $((size / 2)) whole_k > k
    fi
    rm -f k.1 k.film
    quiet $long --spp 70 --film k.1
    quiet $long --spp 160 --checkpoint k --resume --film k.film && grep -q "checkpoint 'k' is damaged" err &&
        grep -q "resumed from 'k.1' at 70" err
    check $? "a damaged checkpoint ($harm) is refused by name, and the one before is used"
    same_files 'to the same bits' k.film undisturbed.film
done
head -c 1000 whole_k > k
cp k k.1
fails "'k.1' is damaged" $long --spp 160 --checkpoint k --resume --film k.film
same_files 'where all are damaged nothing is written over' k k.1

# ---- a full disk ---------------------------------------------------------------------------------

# A limit on the size of files, with its signal ignored, is a disk that is full after one block.
full() # ARGUMENT...
{
    (trap '' XFSZ; ulimit -f 1; "$render" --progress off "$@" > /dev/null 2> err)
}

(trap '' XFSZ; ulimit -f 1; head -c 5000 /dev/zero > probe) 2> /dev/null
if [ "$(wc -c < probe)" -lt 5000 ]; then
    quiet $long --spp 2 -o old.png -o old.pfm --film old.film --checkpoint o
    quiet $long --spp 4 --checkpoint o --resume -o last.png
    for f in old.png old.pfm old.film o o.1; do cp $f was.$f; done
    full $long --spp 8 --seed 5 -o old.png -o old.pfm --film old.film
    [ $? = 1 ] && [ "$(grep -c 'cannot write' err)" -ge 2 ]
    check $? "a full disk: status 1: $(head -n 1 err)"
    full $long --spp 8 --checkpoint o --resume -o last.png
    [ $? = 1 ] && grep -q 'cannot write the checkpoint' err
    check $? "a full disk while a checkpoint is written: $(grep checkpoint err | tail -n 1)"
    for f in old.png old.pfm old.film o o.1; do same_files "$f is what it was" was.$f $f; done
    [ -z "$(ls ./*.part 2> /dev/null)" ]
    check $? 'no partial file is left'
else
    echo 'skip   a full disk: this shell has no ulimit -f'
fi

# ---- models --------------------------------------------------------------------------------------

cat > shop.mtl <<'END'
newmtl red
Kd 0.8 0.1 0.1
newmtl lamp
Ke 5 5 5
END
cat > cube.obj <<'END'
mtllib shop.mtl
v 10 0 0
v 11 0 0
v 11 1 0
v 10 1 0
v 10 0 1
v 11 0 1
v 11 1 1
v 10 1 1
usemtl red
f 4 3 2 1
f 5 6 7 8
f 1 2 6 5
f -6 -5 -1 -2
f 1 5 8 4
f 2 3 7 6
END
quick='--size 40x40 --spp 8 --progress off'
quiet cube.obj $quick
status=$?
[ $status = 0 ] && is_png cube.png && grep -q 'cube.obj has no light of its own: added a sky' err
check $? "a model to a picture in one command: $(grep light err)"
quiet cube.obj $quick --film cube.film --albedo cube.pfm --depth depth.pfm
# Framed: the cube covers a good part of the picture, its red albedo times the coverage is the mean.
{ printf 'PF\n40 40\n-1.0\n'; dd if=/dev/zero bs=12 count=1600 2> /dev/null; } > black.pfm
quiet --compare cube.pfm black.pfm
# red (0.8, 0.1, 0.1): luminance 0.2488
coverage=$(awk '$1 == "mean" { print $3 / 0.2488 }' out)
awk -v c="$coverage" 'BEGIN { exit !(c > 0.3 && c < 0.95) }'
check $? "the model is framed: it covers $coverage of the picture"
# Moved, turned and scaled as a whole it looks the same: the camera follows, and albedo does not depend on light.
quiet cube.obj $quick --scale 3 --translate 5,-7,1 --film moved.film --albedo moved.pfm && quiet --compare moved.pfm cube.pfm
awk -v d="$(compared RMSE)" 'BEGIN { exit !(d < 0.02) }'
check $? "scaled and moved it fills the picture as before: RMSE $(compared RMSE)"
quiet cube.obj $quick --rotate 0,45,0 --film turned.film --albedo turned.pfm && quiet --compare turned.pfm cube.pfm
awk -v d="$(compared RMSE)" 'BEGIN { exit !(d > 0.05) }'
check $? "turned it looks different: RMSE $(compared RMSE)"
# A wedge, and the same with its vertices turned one axis after the other.
printf 'v 0 0 0\nv 3 0 0\nv 0 1 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n' > wedge.obj
awk 'function turn(a) { c = cos(a * 0.017453292519943295); s = sin(a * 0.017453292519943295) }
    $1 == "v" {
        x = $2; y = $3; z = $4
        turn(20); t = c * y - s * z; z = s * y + c * z; y = t
        turn(35); t = c * x + s * z; z = c * z - s * x; x = t
        turn(50); t = c * x - s * y; y = s * x + c * y; x = t
        printf "v %.9g %.9g %.9g\n", x, y, z
        next
    }
    { print }' wedge.obj > by_hand.obj
quiet wedge.obj $quick --rotate 20,35,50 -o w.png --normal turned.pfm &&
    quiet by_hand.obj $quick -o w.png --normal hand.pfm &&
    quiet --compare turned.pfm hand.pfm
awk -v d="$(compared RMSE)" 'BEGIN { exit !(d < 0.02) }'
check $? "--rotate 20,35,50 is as by hand: RMSE $(compared RMSE)"
quiet wedge.obj $quick -o w.png --normal other.pfm && quiet --compare other.pfm hand.pfm
awk -v d="$(compared RMSE)" 'BEGIN { exit !(d > 0.1) }'
check $? "and not turned it differs: RMSE $(compared RMSE)"
# Thrice as large: depths are three times as long.
quiet cube.obj $quick --scale 3 --film moved.film --depth moved.pfm
quiet --compare depth.pfm black.pfm && one=$(compared RMSE) && quiet --compare moved.pfm black.pfm
awk -v a="$one" -v b="$(compared RMSE)" 'BEGIN { exit !(a > 0 && b / a > 2.99 && b / a < 3.01) }'
check $? "three times as large it is three times as far: $one, $(compared RMSE)"
quiet cube.obj $quick --sky 1 --film sky.film && ! grep -q 'no light' err
check $? 'with --sky nothing is added'
# Under a sky of 1 alone no value is above 1, and what misses the cube is 1.
quiet --merge sky.film -o sky.pfm && quiet --compare sky.pfm black.pfm
awk '$1 == "RMSE" { r = $2 } END { exit !(r > 0.3 && r < 1) }' out
check $? "a sky of radiance 1 lights it: RMSE from black $(compared RMSE)"
quiet cube.obj $quick --floor --film floor.film --sky c.png --albedo floor.pfm && quiet --compare floor.pfm cube.pfm
awk '$1 == "mean" { exit !($3 > $5 + 0.05 && $3 < 0.5) }' out
check $? "a floor of albedo 0.5, under a picture as the sky: $(grep mean out)"
sed 's/usemtl red/usemtl lamp/' cube.obj > glow.obj
quiet glow.obj --size 20x20 --spp 8 --progress off && ! grep -q 'no light' err
check $? 'a model that emits keeps its own light alone'
quiet cornell --size 20x20 --spp 4 --progress off --eye 278,273,-800 --look-at 278,273,0 --aperture 20 --film lens.film &&
    quiet cornell --size 20x20 --spp 4 --progress off --fov 20 --film narrow.film && quiet --compare narrow.film lens.film
awk -v d="$(compared RMSE)" 'BEGIN { exit !(d > 0.01) }'
check $? 'the camera of a canonical scene can be moved'
for subject in glass-ball cube.obj; do
    quiet $subject --size 20x20 --spp 4 --progress off --eye 3,4,5 --film leaning.film &&
        quiet $subject --size 20x20 --spp 4 --progress off --eye 3,4,5 --up 0,1,0 --film upright.film
    same_files "$subject: a moved camera stands upright" leaning.film upright.film
done
# The lamp is left above the eye: a wall that faces left is brighter than one that faces right, and so is the upper side
# of a roof than its lower one.
for side in '-1 0' '1 0' '0 1' '0 -1'; do # x and y of a normal whose z is 1
    echo "$side" | awk '
        function corner(x, y) { print "v", x, y, -($1 * x + $2 * y) }
        { corner(-1, -1); corner(1, -1); corner(1, 1); corner(-1, 1); print "f 1 2 3 4" }' > side.obj
    quiet side.obj $quick --sky 0 --lamp 9 --eye 0,0,20 --fov 15 --film side.film && quiet --compare side.film side.film &&
        awk '$1 == "mean" { print $3 }' out
done > sides
awk '{ v[NR] = $1 } END { exit !(NR == 4 && v[1] > 1.2 * v[2] && v[3] > 1.2 * v[4]) }' sides
check $? "light comes from the left and from above: $(tr '\n' ' ' < sides)"
printf 'v 0 0 0\nv 1 0 0\nf 1 2 7\n' > wrong.obj
fails wrong.obj wrong.obj

echo "check_tool: $passed passed, $failed failed"
[ $failed = 0 ]
