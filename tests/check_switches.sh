#!/bin/sh
# Every switch of the header compiles without a warning, alone and in random pairs, in every standard and
# with every compiler at hand; and what a switch leaves out is gone from the object file.
#
#   sh tests/check_switches.sh           the short form, part of `make test`: $CC, C99, each switch alone
#   sh tests/check_switches.sh full      all compilers, C99 to C17, C++11 to C++20, pairs of switches
#
# in the project's top directory. JOBS (2) compilations run at a time. What is not installed is skipped,
# and a line says so.

set -u
CC=${CC:-cc}
CXX=${CXX:-c++}
JOBS=${JOBS:-2}
mode=${1:-short}
header=pathtracer.h
dir=build/check_switches
passed=0
failed=0
started=0

warn='-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wdouble-promotion'
warn_c="$warn -Wstrict-prototypes -Wmissing-prototypes"

rm -rf "$dir"
mkdir -p "$dir" || exit 1

have() { command -v "${1%% *}" > /dev/null 2>&1; }
skip() { echo "skip   $*"; }
ok() { passed=$((passed + 1)); [ "$mode" = full ] || [ -n "${VERBOSE-}" ] && echo "ok     $*"; return 0; }
bad() { failed=$((failed + 1)); echo "FAIL   $*"; }

# ---- programs to compile -------------------------------------------------------------------------

cat > "$dir/one.c" << 'END'
#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
END
cp "$dir/one.c" "$dir/one.cpp"

# The plain include, twice, among the standard headers; a use of each initialiser.
cat > "$dir/plain.c" << 'END'
#include <stdio.h>
#include "pathtracer.h"
#include <stdlib.h>
#include "pathtracer.h"
int plain(void);
int plain(void)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    pt_stats stats = PT_STATS_INIT;
    pt_splat_list splats = PT_SPLAT_LIST_INIT;
    pt_splat_list_free(&splats);
    pt_report_free(&report);
    pt_film_free(&film);
    pt_scene_free(&scene);
    return stats.n > 0;
}
END
cp "$dir/plain.c" "$dir/plain.cpp"

# The hooks for memory, with and without a use of the user pointer, and for assertions.
cat > "$dir/hooks.c" << 'END'
#include <stddef.h>
void *my_malloc(size_t size, void *user);
void *my_realloc(void *pointer, size_t size, void *user);
void my_free(void *pointer, void *user);
void my_assert(int holds);
#define PT_MALLOC(size, user) my_malloc(size, user)
#define PT_REALLOC(pointer, size, user) my_realloc(pointer, size, user)
#define PT_FREE(pointer, user) my_free(pointer, user)
#define PT_ASSERT(x) my_assert(!!(x))
#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
END
cat > "$dir/hooks_plain.c" << 'END'
#include <stdlib.h>
#define PT_MALLOC(size, user) malloc(size)
#define PT_REALLOC(pointer, size, user) realloc(pointer, size)
#define PT_FREE(pointer, user) free(pointer)
#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
END
cat > "$dir/hooks_two.c" << 'END'
#include <stdlib.h>
#define PT_MALLOC(size, user) malloc(size)
#define PT_FREE(pointer, user) free(pointer)
#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
END

# A scene or a render that needs what the switch SWITCH left out: an error that names the switch, not another
# picture. Compiled with the switch and run. Materials are made by hand, as their constructors are gone too.
cat > "$dir/needs.c" << 'END'
#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>
static int failures;
static void refused(int refuses, const char *what, const char *sentence)
{
    if (refuses && sentence && strstr(sentence, SWITCH)) return;
    printf("%s: %s\n", what, sentence ? sentence : "no sentence");
    failures++;
}
static void material(pt_material_kind kind, double roughness, const char *what)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_result result;
    pt_material m;
    int id;
    memset(&m, 0, sizeof m);
    m.kind = kind;
    m.roughness = (pt_real)roughness;
    m.exponent = 10;
    m.eta = pt_rgb_grey(1);
    id = pt_add_material(&scene, m);
    result = pt_commit(&scene);
    refused(id == -1 && result == PT_ERROR_LEFT_OUT, what, pt_scene_error(&scene));
    pt_scene_free(&scene);
}
static void method(const char *name)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    pt_render_desc d = pt_render_defaults();
    pt_result result;
    d.camera = pt_camera_look_at(pt_v3(0, 0, 0), pt_v3(0, 0, -1), pt_v3(0, 1, 0), 40);
    d.width = d.height = 1;
    d.method = name;
    if (pt_commit(&scene) != PT_OK) exit(1);
    result = pt_render(&scene, &d, &film, &report);
    refused(result != PT_OK, name, report.error);
    pt_film_free(&film);
    pt_report_free(&report);
    pt_scene_free(&scene);
}
static void write_text(const char *name, const char *begin, const char *text)
{
    FILE *file = fopen(name, "w");
    if (!file || fprintf(file, "%s%s\n", begin, text) < 0 || fclose(file) != 0) exit(1);
}
static void model(const char *lines)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_obj_info info;
    pt_result result;
    write_text(DIR "/model.mtl", "newmtl a\n", lines);
    write_text(DIR "/model.obj", "mtllib model.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3", "");
    result = pt_load_obj(&scene, DIR "/model.obj", NULL, &info);
    refused(result == PT_ERROR_LEFT_OUT && strstr(info.error, SWITCH), lines, pt_scene_error(&scene));
    pt_scene_free(&scene);
}
int main(void)
{
    (void)material;
    (void)method;
    (void)model;
    NEEDS
    return failures != 0;
}
END

# ---- compiling -----------------------------------------------------------------------------------

# try LABEL COMMAND...: the command must succeed and say nothing. Runs in the background; collect ends
# them all.
try()
{
    started=$((started + 1))
    echo "$1" > "$dir/job.$started"
    shift
    ( "$@" > "$dir/job.$started.out" 2>&1; echo $? > "$dir/job.$started.status" ) &
    [ $((started % JOBS)) != 0 ] || wait
}

collect()
{
    wait
    job=1
    while [ $job -le $started ]; do
        label=$(cat "$dir/job.$job")
        if [ "$(cat "$dir/job.$job.status")" = 0 ] && [ ! -s "$dir/job.$job.out" ]; then
            ok "$label"
        else
            bad "$label"
            grep -E 'error|warning' "$dir/job.$job.out" | head -n 6
        fi
        job=$((job + 1))
    done
    rm -f "$dir"/job.*
    started=0
}

# What makes a compiler look at everything without making code for it. gcc tells of unused functions only
# when it compiles; tcc writes an object file always.
checks_only() { # COMPILER
    [ "$1" = "${known-}" ] || known=$1 version=$($1 --version 2> /dev/null)
    case $version in *clang*) true ;; *) false ;; esac
}

# What the header makes in C99, alone or with one switch, is kept for the symbols that are looked at afterwards.
object_of() # FILE FLAGS
{
    case $mode,$# in
    short,2) [ "$1 $2" != 'one.c -std=c99' ] || { echo full; return; } ;;
    short,3) [ "$1 $2" != 'one.c -std=c99' ] || { echo "full$3"; return; } ;;
    esac
    echo $((started + 1))
}

# compile LABEL COMPILER FILE FLAGS...
compile()
{
    label=$1 compiler=$2 file=$3
    shift 3
    if checks_only "$compiler"; then
        set -- -fsyntax-only "$@"
    else
        set -- -O0 -c -o "$dir/$(object_of "$file" "$@").o" "$@"
    fi
    # shellcheck disable=SC2086
    case $file in
    *.cpp) try "$label" $compiler $warn -Werror -I. "$@" "$dir/$file" ;;
    *) try "$label" $compiler $warn_c -Werror -I. "$@" "$dir/$file" ;;
    esac
}

# The names in the table SWITCHES that are given without a value.
switches=$(sed -n '/^   SWITCHES/,/^   CONVENTIONS/p' $header |
    awk '/^       PT_[A-Z_]+ / && $1 != "PT_ALLOW_FAST_MATH" { print $1 }')
count=$(echo "$switches" | wc -l)
[ "$count" -ge 10 ] || bad "the table SWITCHES of $header names only $count switches"

# Pairs of switches: a congruential generator with a fixed seed, the same pairs on every machine.
pairs()
{
    echo "$switches" | awk -v wanted="$1" '
        { name[NR] = $1 }
        END {
            state = 20
            while (made < wanted) {
                state = (state * 1103515245 + 12345) % 2147483648
                a = 1 + int(state / 65536) % NR
                state = (state * 1103515245 + 12345) % 2147483648
                b = 1 + int(state / 65536) % NR
                if (a == b || (a, b) in seen) continue
                seen[a, b] = seen[b, a] = 1
                print "-D" name[a] " -D" name[b]
                made++
            }
        }'
}

each_switch() # COMPILER FILE STANDARD
{
    compile "$1 $3" "$1" "$2" "$3"
    for s in $switches; do compile "$1 $3 -D$s" "$1" "$2" "$3" "-D$s"; done
}

small_things() # COMPILER
{
    compile "$1: declarations only, included twice" "$1" plain.c -std=c99
    compile "$1: own memory functions" "$1" hooks.c -std=c99
    compile "$1: memory functions without user pointer" "$1" hooks_plain.c -std=c99
    compile "$1: own PTDEF" "$1" one.c -std=c99 -DPTDEF=extern
}

understands() { # COMPILER FILE STANDARD
    echo 'int x;' > "$dir/empty.${2##*.}"
    $1 "$3" -c -o "$dir/empty.o" "$dir/empty.${2##*.}" > /dev/null 2>&1
}

# ---- symbols -------------------------------------------------------------------------------------

# object NAME FILE FLAGS...: compiles to build/check_switches/NAME.o
object()
{
    name=$1 file=$2
    shift 2
    $CC -std=c99 -O0 -I. "$@" -c "$dir/$file" -o "$dir/$name.o" 2> "$dir/$name.out"
}

kept() { [ -s "$dir/$1.o" ]; }

# gone LABEL FLAG PATTERN: no symbol, defined or wanted, matches the pattern, which the full build does
# match
gone()
{
    if ! kept "full$2" && ! object "full$2" one.c "$2"; then
        bad "$1: does not compile"
    elif ! nm "$dir/full.o" | awk '{ print $NF }' | grep -qE "^_?($3)\$"; then
        bad "$1: the full build has no such symbol, so the check sees nothing: $3"
    elif nm "$dir/full$2.o" | awk '{ print $NF }' | grep -E "^_?($3)\$" > "$dir/left_out.txt"; then
        bad "$1: still there: $(tr '\n' ' ' < "$dir/left_out.txt")"
    else
        ok "$1: symbols are gone"
    fi
}

none() # LABEL AWK-CONDITION OBJECT: no line of nm fulfils the condition (type in t, name in s)
{
    found=$(nm "$dir/$3.o" | awk '{ t = $(NF - 1); s = $NF; sub(/^_/, "", s) } '"$2"' { printf "%s ", s }')
    if [ -z "$found" ]; then ok "$1"; else bad "$1: $found"; fi
}

symbols()
{
    have nm || { skip 'symbols: nm is not installed'; return; }
    kept full || object full one.c || { bad "$CC does not compile the header"; head -n 5 "$dir/full.out"; return; }
    nm "$dir/full.o" | grep -q ' T _*pt_render$' || { skip "symbols: nm cannot read what $CC makes"; return; }
    none 'all that is public begins with pt_' 't == "T" && s !~ /^pt_/' full
    # Without -fno-pie constant tables of pointers are data until the loader has filled them in.
    if object fixed one.c -fno-pie; then none 'no global that can be written to' 't ~ /^[BbDdCGgSs]$/' fixed; fi
    gone PT_NO_THREADS -DPT_NO_THREADS 'pthread_.*'
    gone PT_NO_STDIO -DPT_NO_STDIO \
        'fopen|fwrite|f?puts|f?putc|fclose|f?printf|sn?printf|remove|rename|fsync|pt_report_print|pt_write_.*|pt_film_read'
    gone PT_NO_FILES -DPT_NO_FILES \
        'fopen|fclose|remove|rename|fsync|pt_write_.*|pt_read_image|pt_film_(read|write)|pt_load_obj|pt_report_write_.*|pti_(inflate|png|obj)_.*|pti_film_(head|put|plane)s?'
    gone PT_NO_OBJ -DPT_NO_OBJ 'pt_load_obj|pti_(obj|mtl|table|take_number)_?.*'
    gone PT_NO_BVH -DPT_NO_BVH 'pti?_bvh_.*'
    gone PT_NO_SIMD -DPT_NO_SIMD 'pti_(build_(wide|small|binary)|find_parting|write_(tree|flat)|.*_lanes).*'
    gone PT_NO_ENVIRONMENT -DPT_NO_ENVIRONMENT 'pt_set_environment.*|pt_environment_radiance|pti_map_.*|pt_scene_pool'
    gone PT_NO_MICROFACET -DPT_NO_MICROFACET \
        'pt_material_(conductor|rough_dielectric|oren_nayar)|pti?_ggx_.*|pt_fresnel_conductor|pti_(eval|pdf|sample)_microfacet'
    gone PT_NO_PHONG -DPT_NO_PHONG 'pt_material_(phong|blinn)|pti_.*phong.*'
    gone PT_NO_COAT -DPT_NO_COAT 'pt_material_coat|pti_.*coat.*'
    gone PT_NO_MEASURED -DPT_NO_MEASURED 'pt_material_measured|pt_measured_.*|pti_merl_.*'
    gone PT_NO_TEXTURES -DPT_NO_TEXTURES 'pt_texture_eval|pti_texel|pti_check_texture|pt_scene_materials'
    gone PT_NO_WHITTED -DPT_NO_WHITTED 'pt_li_(local|whitted|distribution|branching)|pti_whitted_.*|pti_solve'
    gone PT_NO_LPE -DPT_NO_LPE 'pt_lpe_.*|pti_lpe_.*|pti_parse_.*|pti_classify|pti_advance'
    gone PT_NO_REPORT -DPT_NO_REPORT 'pt_report_print|pt_report_write_.*'
    gone PT_NO_SCENES -DPT_NO_SCENES 'pt_scenes|pt_scene_find|pt_scene_cornell.*|pt_cornell_.*'
    gone PT_ONLY_PATH -DPT_ONLY_PATH \
        'pt_li_(path_plain|path_light|local|whitted|distribution|branching)|pt_lpe_.*|pt_scenes|pt_scene_cornell'
    object static one.c -DPT_STATIC && none 'PT_STATIC: nothing is public' 't == "T"' static
    object hooks hooks.c && none 'own memory functions: malloc and its kin are gone' \
        's ~ /^(malloc|calloc|realloc|free)$/' hooks
}

# must_fail LABEL TEXT FLAGS...: the compiler refuses, and says so in the header's words
must_fail()
{
    label=$1 text=$2
    shift 2
    if $CC -std=c99 -I. -c -o "$dir/fail.o" "$@" > "$dir/fail.out" 2>&1; then
        bad "$label: is not refused"
    elif grep -qF "$text" "$dir/fail.out"; then
        ok "$label: is refused"
    else
        bad "$label: is refused for another reason"
    fi
}

refusals()
{
    must_fail 'two of three memory functions' 'or none' "$dir/hooks_two.c"
    if echo | $CC -ffast-math -dM -E - 2> /dev/null | grep -q '__FAST_MATH__'; then
        must_fail '-ffast-math' 'PT_ALLOW_FAST_MATH' -ffast-math "$dir/one.c"
        compile "$CC -ffast-math, allowed" "$CC" one.c -std=c99 -ffast-math -DPT_ALLOW_FAST_MATH
    else
        skip "-ffast-math: $CC does not tell of it"
    fi
    if echo | $CC -mfpmath=387 -dM -E - 2> /dev/null | grep -q '__FLT_EVAL_METHOD__ 2'; then
        must_fail 'x87 arithmetic' 'x87' -mfpmath=387 "$dir/one.c"
    else
        skip "x87 arithmetic: $CC has none, or does not tell of it"
    fi
}

# names SWITCH NEEDS: what the statements NEEDS ask for is refused with a sentence that names the switch
names()
{
    if ! $CC -std=c99 -O0 -I. "-D$1" "-DSWITCH=\"$1\"" "-DDIR=\"$dir\"" "-DNEEDS=$2" "$dir/needs.c" -o "$dir/needs" -lm -pthread > "$dir/needs.out" 2>&1; then
        bad "$1: the program that needs it does not compile"
        head -n 5 "$dir/needs.out"
    elif "$dir/needs" > "$dir/needs.out" 2>&1; then
        ok "$1: what needs it is refused, and the sentence names the switch"
    else
        bad "$1: $(tr '\n' ';' < "$dir/needs.out")"
    fi
}

left_out()
{
    names PT_NO_MICROFACET 'material(PT_MATERIAL_CONDUCTOR, 0, "metal"); material(PT_MATERIAL_CONDUCTOR, 0.5, "rough metal");
        material(PT_MATERIAL_DIELECTRIC, 0.5, "rough glass"); material(PT_MATERIAL_OREN_NAYAR, 0.3, "Oren-Nayar");
        model("Pm 1"); model("illum 7\nPr 0.5"); model("illum 5\nKd 0\nKs 1\nPr 0.5");'
    names PT_NO_PHONG 'material(PT_MATERIAL_PHONG, 0, "Phong"); material(PT_MATERIAL_BLINN, 0, "Blinn-Phong");
        model("Kd 0.5\nKs 0.5\nNs 9"); model("Pr 0.5");'
    names PT_NO_COAT 'material(PT_MATERIAL_COAT, 0, "coat"); model("Pr 0");'
    names PT_NO_TEXTURES 'model("map_Kd nowhere.png");'
    names PT_NO_MEASURED 'material(PT_MATERIAL_MEASURED, 0, "measured");'
    names PT_NO_WHITTED 'method("local"); method("whitted"); method("distribution"); method("branching");'
    names PT_ONLY_PATH 'method("path-light"); method("path-plain");'
}

# ---- the two forms -------------------------------------------------------------------------------

short_form()
{
    each_switch "$CC" one.c -std=c99
    small_things "$CC"
    if have "$CXX"; then
        compile "$CXX -std=c++11" "$CXX" one.cpp -std=c++11
        compile "$CXX -std=c++11: declarations only" "$CXX" plain.cpp -std=c++11
    else
        skip "$CXX is not installed"
    fi
    refusals
    collect
    symbols
    left_out
}

c_compiler() # COMPILER
{
    have "$1" || { skip "$1 is not installed"; return; }
    each_switch "$1" one.c -std=c99
    small_things "$1"
    for standard in c11 c17 gnu17; do
        if understands "$1" one.c -std=$standard; then
            compile "$1 -std=$standard" "$1" one.c -std=$standard
            compile "$1 -std=$standard -DPT_DOUBLE" "$1" one.c -std=$standard -DPT_DOUBLE
        else
            skip "$1 does not know -std=$standard"
        fi
    done
    pairs 12 > "$dir/pairs"
    while read -r a b; do compile "$1 -std=c99 $a $b" "$1" one.c -std=c99 "$a" "$b"; done < "$dir/pairs"
}

cxx_compiler() # COMPILER
{
    have "$1" || { skip "$1 is not installed"; return; }
    # The switches select the same code in C++; one compiler, the faster one, looks at each.
    if [ "$1" != g++ ] || ! have clang++; then each_switch "$1" one.cpp -std=c++11; fi
    for standard in c++11 c++14 c++17 c++20; do
        if understands "$1" one.cpp -std=$standard; then
            compile "$1 -std=$standard" "$1" one.cpp -std=$standard
            compile "$1 -std=$standard -DPT_DOUBLE" "$1" one.cpp -std=$standard -DPT_DOUBLE
            compile "$1 -std=$standard: declarations only" "$1" plain.cpp -std=$standard
        else
            skip "$1 does not know -std=$standard"
        fi
    done
}

full_form()
{
    c_compiler gcc
    c_compiler clang
    cxx_compiler g++
    cxx_compiler clang++
    if have tcc; then
        try 'tcc -std=c99' tcc -std=c99 -Wall -Werror -I. -c -o "$dir/tcc.o" "$dir/one.c"
    else
        skip 'tcc is not installed'
    fi
    refusals
    collect
    symbols
    left_out
}

case $mode in
short) short_form ;;
full) full_form ;;
*) echo 'usage: check_switches.sh [short|full]' >&2; exit 2 ;;
esac
rm -f "$dir"/*.o
echo "check_switches: $passed passed, $failed failed"
[ $failed = 0 ]
