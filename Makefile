# pathtracer.h - builds the renderer, the tests, the examples. `make help` lists the targets.
#
# Needs a C99 compiler, make and libm. CC, CFLAGS, LDFLAGS and EXTRA (more flags, such as EXTRA=-DPT_DOUBLE)
# are respected; everything made goes to build/.

.SUFFIXES:

CFLAGS ?= -O2
CXXFLAGS ?= $(CFLAGS)
ifeq ($(origin CXX),default)
CXX = c++
endif
# How many things `make test` does at a time; make's own -j wins.
JOBS ?= 2
AT_A_TIME = $(MAKE) --no-print-directory $(if $(findstring jobserver,$(MAKEFLAGS)),,-j$(JOBS))

WARN = -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wdouble-promotion
WARN_C = $(WARN) -Wstrict-prototypes -Wmissing-prototypes
# -ffp-contract=off: two builds, and two instances of the path integrator, give the same bits.
FIXED = -std=c99 -ffp-contract=off
FIXED_CXX = -std=c++11 -ffp-contract=off
LDLIBS = -lm -pthread

BUILD_C = $(CC) $(FIXED) $(WARN_C) $(CFLAGS) $(EXTRA) -I. -pthread $(LDFLAGS)
BUILD_CXX = $(CXX) $(FIXED_CXX) $(WARN) $(CXXFLAGS) $(EXTRA) -I. -pthread $(LDFLAGS)

# The picture that plain `make` renders.
SCENE = cornell
SIZE = 360x360
SPP = 64

SHARES = $(shell k=1; while [ $$k -le $(JOBS) ]; do echo $$k; k=$$((k + 1)); done)
TESTS = $(patsubst tests/%.c,%,$(wildcard tests/test_*.c))
# Those that take longest begin first, so that none is left alone at the end; scripts look at no numbers.
LONGEST = $(foreach t,test_transport test_lockstep_plain test_oracles test_lockstep test_together test_materials test_radiometry,$(filter $t,$(TESTS)))
SCRIPTS = $(if $(SEED),,switches tool docs sections lessons)
STARTED = $(LONGEST:%=build/test/%.log) $(SCRIPTS:%=build/test/check_%.log) $(TESTS:%=build/test/%.log)
TEST_LOGS = $(SCRIPTS:%=build/test/check_%.log) $(TESTS:%=build/test/%.log)
LESSONS = $(patsubst lessons/%.c,%,$(sort $(wildcard lessons/[0-9][0-9]_*.c)))
EXAMPLES = minimal render scenes own_threads two_files cpp_user mpi_render
MPICC = mpicc
# Samples per pixel of the contact sheet.
SHEET_SPP = 128

# The first and the last seed of test-seeds.
FROM = 1
SEEDS = 100
TO = $(shell echo $$(($(FROM) + $(SEEDS) - 1)))

.PHONY: all scenes lessons lesson-programs course exercises test test-long test-seeds test-table test-logs examples bench bench-embree report book mutants stress fuzz clean help FORCE
# A program that was built only half is no program.
.DELETE_ON_ERROR:

all: build/render
	build/render $(SCENE) --size $(SIZE) --spp $(SPP) -o build/cornell.ppm -o build/cornell.png \
	    --csv build/cornell.csv --svg build/cornell.svg

help:
	@echo 'make            render the Cornell box to build/cornell.ppm and .png; error against run time on stdout'
	@echo 'make scenes     all scenes, bounces, methods and classes of light paths in build/scenes.png'
	@echo 'make test       all checks; ends with a line "N passed, N failed"'
	@echo 'make test-long  the same with the checks that need more samples'
	@echo 'make test-seeds the statistical checks with other random numbers: SEEDS=100 of them, from FROM=1 on'
	@echo 'make test-table writes tests/README.md: each quantity, its exact value, and what was measured'
	@echo 'make lessons    build and run all lessons; each must pass and print what lessons/README.md shows; N=07 runs one'
	@echo 'make course     the same, and lessons/README.md and lessons/img/ made anew from them'
	@echo 'make exercises  build each lesson with each of its exercises, -DEX=1 and on, and run it; N=07 tries one'
	@echo 'make examples   build and run the programs of examples/'
	@echo 'make bench      rays per second, what a path costs over its rays, what leaving out saves, compile time; CSV on stdout'
	@echo 'make bench-embree rays and tree against Embree 3 where it is installed; CSV on stdout; MESHES=room-118k'
	@echo 'make report     error against run time of all scenes and methods: build/report/index.html; SCENE METHOD SECONDS=60'
	@echo 'make book       the course as one page: build/book/index.html'
	@echo 'make mutants    break the header, one change at a time; every broken copy must fail a check; GENERATED=n ALL=1'
	@echo 'make stress     numbers at their ends, float and double side by side: table, build/stress.csv and .html (< 20 min)'
	@echo 'make fuzz       hostile calls of every public function under sanitizers: SECONDS=10 of them'
	@echo 'make clean      remove build/'
	@echo 'variables       CC CFLAGS LDFLAGS EXTRA JOBS; SHORT=1 SEED=n for the tests; SCENE SIZE SPP for plain make; N for lessons'

clean:
	rm -rf build

# Rewritten only when compilers or flags change, so that what was built with others is built anew.
build/flags: FORCE
	@mkdir -p build
	@echo '$(BUILD_C) | $(BUILD_CXX)' | cmp -s - $@ || echo '$(BUILD_C) | $(BUILD_CXX)' > $@

FORCE:

build/render: examples/render.c $(wildcard examples/render/*.h) pathtracer.h build/flags
	$(BUILD_C) examples/render.c -o $@ $(LDLIBS)

# ---- examples ------------------------------------------------------------------------------------

examples: $(EXAMPLES:%=build/examples/%)
	@cd build/examples && for e in $(EXAMPLES); do \
	    echo "== $$e"; \
	    case $$e in \
	    render) set -- ./render cornell-spheres --size 64x64 --spp 16 --progress off -o render.png ;; \
	    scenes) set -- ./scenes 1 ;; \
	    mpi_render) set -- ./mpi_render cornell 4 ;; \
	    *) set -- ./$$e ;; \
	    esac; \
	    if [ -s $$e ]; then "$$@" || exit 1; else echo 'skipped: its compiler is not installed'; fi; \
	done

build/examples/minimal: examples/minimal.c pathtracer.h build/flags
	@mkdir -p build/examples
	$(BUILD_C) examples/minimal.c -o $@ $(LDLIBS)

build/examples/scenes: examples/scenes.c pathtracer.h build/flags
	@mkdir -p build/examples
	$(BUILD_C) examples/scenes.c -o $@ $(LDLIBS)

scenes: build/examples/scenes
	build/examples/scenes $(SHEET_SPP) build/scenes.png

build/examples/render: build/render
	@mkdir -p build/examples
	cp build/render $@

build/examples/own_threads: examples/own_threads.c pathtracer.h build/flags
	@mkdir -p build/examples
	$(BUILD_C) examples/own_threads.c -o $@ $(LDLIBS)

build/examples/two_files: examples/two_files/main.c examples/two_files/pathtracer_impl.c pathtracer.h build/flags
	@mkdir -p build/examples
	$(BUILD_C) examples/two_files/main.c examples/two_files/pathtracer_impl.c -o $@ $(LDLIBS)

# An empty file stands for the program where there is no C++ compiler.
build/examples/cpp_user: examples/cpp_user.cpp pathtracer.h build/flags
	@mkdir -p build/examples
	@if command -v $(firstword $(CXX)) > /dev/null 2>&1; then \
	    echo '$(BUILD_CXX) examples/cpp_user.cpp -o $@ $(LDLIBS)'; \
	    $(BUILD_CXX) examples/cpp_user.cpp -o $@ $(LDLIBS); \
	else : > $@; fi

# The same where there is no MPI; one rank is run, which needs no mpirun.
build/examples/mpi_render: examples/mpi_render.c pathtracer.h build/flags
	@mkdir -p build/examples
	@if command -v $(MPICC) > /dev/null 2>&1; then \
	    set -- $(FIXED) $(WARN_C) $(CFLAGS) $(EXTRA) -I. -pthread $(LDFLAGS) examples/mpi_render.c -o $@ $(LDLIBS); \
	    echo "$(MPICC) $$*"; \
	    OMPI_CC='$(CC)' MPICH_CC='$(CC)' $(MPICC) "$$@"; \
	else : > $@; fi

# ---- lessons -------------------------------------------------------------------------------------

# N=07, or N='07 08', takes some of them.
COURSE = CC='$(CC)' CFLAGS='$(CFLAGS)' EXTRA='$(EXTRA)' WARN='$(WARN_C)' sh lessons/course.sh
CHOSEN = $(if $(N),$(foreach n,$(N),$(filter $(n)_%,$(LESSONS))),$(LESSONS))

# Two are built at a time, then they run one after the other, so that seconds are their own.
lessons: lesson-programs
	@$(COURSE) run $(N)

course: lesson-programs
	@$(COURSE) write $(N)

exercises:
	@$(COURSE) exercises $(N)

lesson-programs:
	+@$(AT_A_TIME) $(CHOSEN:%=build/lessons/%)

build/lessons/%: lessons/%.c pathtracer.h build/flags
	@mkdir -p build/lessons
	$(BUILD_C) $< -o $@ $(LDLIBS)

# ---- tests ---------------------------------------------------------------------------------------

# Builds and runs two at a time unless make was told how many; the counts are added up at the end. SEED=n runs
# the statistical checks alone. What many wait for is built first: make keeps to the order of STARTED only then.
SHARED = build/test/implementation.o $(if $(SEED),,build/render)
test:
	@rm -f build/test/*.log
	+@$(AT_A_TIME) -k $(SHARED) || true
	+@$(AT_A_TIME) -k test-logs || true
	@sh tests/run.sh sum $(TEST_LOGS)

test-long:
	@LONG=1 $(MAKE) --no-print-directory test

# The programs are built once; then each seed takes a quarter of the samples.
test-seeds: $(TESTS:%=build/test/%)
	@MAKE='$(MAKE) --no-print-directory' sh tests/run.sh seeds $(FROM) $(TO)

test-table: test
	@sh tests/table.sh $(TEST_LOGS) > build/test/README.md
	@mv build/test/README.md tests/README.md
	@echo 'wrote tests/README.md'

test-logs: $(STARTED)

# Kept for the next run.
.PRECIOUS: build/test/test_%

build/test/implementation.o: tests/implementation.c pathtracer.h build/flags
	@mkdir -p build/test
	$(BUILD_C) -c $< -o $@

build/test/test_%: tests/test_%.c $(wildcard tests/*.h) pathtracer.h build/test/implementation.o build/flags
	@mkdir -p build/test
	$(BUILD_C) -Itests -DPT_TEST_LINKED $< build/test/implementation.o -o $@ $(LDLIBS)

build/test/test_stress: tests/stress.c
build/test/test_wide_plain build/test/test_wide_avx2: tests/test_wide.c
build/test/test_lockstep_plain build/test/test_lockstep_avx2 build/test/test_lockstep_avx512: tests/test_lockstep.c

build/test/test_%.log: build/test/test_% FORCE
	@sh tests/run.sh one $@ ./$<

build/test/check_tool.log: build/render
build/test/check_%.log: tests/check_%.sh pathtracer.h FORCE
	@mkdir -p build/test
	@RENDER=build/render CC='$(CC)' CFLAGS='$(CFLAGS)' EXTRA='$(EXTRA)' sh tests/run.sh one $@ sh $<

# ---- measuring, and testing the tests ------------------------------------------------------------

build/bench: tests/bench/bench.c pathtracer.h build/flags
	$(BUILD_C) tests/bench/bench.c -o $@ $(LDLIBS)

# SCENE is that of plain make; here all scenes are the default.
REPORT_SCENE = $(if $(filter command line environment,$(origin SCENE)),--scene $(SCENE))
report: build/report/program
	@mkdir -p build/report/references
	build/report/program build/report --seconds $(if $(filter command line environment,$(origin SECONDS)),$(SECONDS),60) $(REPORT_SCENE) $(if $(METHOD),--method $(METHOD)) \
	    --flags '$(strip $(FIXED) $(CFLAGS) $(EXTRA))'

build/report/program: tests/bench/report.c pathtracer.h build/flags
	@mkdir -p build/report
	$(BUILD_C) tests/bench/report.c -o $@ $(LDLIBS)

book:
	@sh lessons/book.sh build/book

bench: build/bench
	@CC='$(CC)' CFLAGS='$(CFLAGS)' build/bench

# Only where Embree 3 is installed (Debian: libembree-dev). One build for the machine, one as everything is built, one in plain C.
# MESHES=room-118k takes one; tests/bench/embree.c names them.
bench-embree: tests/bench/embree.c pathtracer.h
	@mkdir -p build
	@if ! echo '#include <embree3/rtcore.h>' | $(CC) -E - > /dev/null 2>&1; then \
	    echo 'skipped: Embree 3 is not installed'; exit 0; fi; \
	echo 'name,value,unit,reference,ratio,low,high'; \
	for lanes in native default plain; do \
	    case $$lanes in native) flags=-march=native ;; default) flags= ;; plain) flags=-DPT_NO_INTRINSICS ;; esac; \
	    $(CC) -std=gnu99 -ffp-contract=off $(CFLAGS) $(EXTRA) $$flags -I. -pthread tests/bench/embree.c -o build/embree-$$lanes \
	        $(LDFLAGS) -lembree3 $(LDLIBS) && build/embree-$$lanes $(MESHES) || exit 1; \
	done

# 1: all of them; n: every n-th, JOBS of n * JOBS shares.
SLICES = 1

build/mutants/run: tests/mutants.c build/flags
	@mkdir -p build/mutants
	$(BUILD_C) tests/mutants.c -o $@

# JOBS shares at a time. GENERATED=n draws n changes that nobody chose, ALL=1 tries also those that are listed
# as no error, ONLY=name takes one mutant.
GENERATED ?= 200
mutants: build/mutants/run
	@rm -f build/mutants/share*.log
	@for k in $(if $(ONLY),1,$(SHARES)); do \
	    CC='$(CC)' sh tests/run.sh one build/mutants/share$$k.log build/mutants/run \
	        $(if $(ONLY),--only $(ONLY),--share $$k/$$(($(JOBS) * $(SLICES)))) --generate $(GENERATED) $(if $(ALL),--all) $(TESTS) & \
	done; wait
	@sh tests/run.sh sum build/mutants/share*.log

# At most 4 GiB and 20 minutes on two cores; the report fails if a row does, or if one of the two did not end.
STRESSES = build/stress/float build/stress/double build/stress/report
stress: $(STRESSES)
	@ulimit -v 4194304; ulimit -t 1200; for p in float double; do \
	    echo "stress: $$p"; build/stress/$$p > build/stress/$$p.txt || true; done
	@build/stress/report build/stress/float.txt build/stress/double.txt build/stress.csv build/stress.html

build/stress/float: tests/stress.c $(wildcard tests/*.h) pathtracer.h build/flags
	@mkdir -p build/stress
	$(BUILD_C) -UPT_DOUBLE -Itests tests/stress.c -o $@ $(LDLIBS)

build/stress/double: tests/stress.c $(wildcard tests/*.h) pathtracer.h build/flags
	@mkdir -p build/stress
	$(BUILD_C) -DPT_DOUBLE -Itests tests/stress.c -o $@ $(LDLIBS)

build/stress/report: tests/stress_report.c pathtracer.h build/flags
	@mkdir -p build/stress
	$(BUILD_C) tests/stress_report.c -o $@ $(LDLIBS)

# SEED=n for other calls.
SECONDS = 10
fuzz: build/fuzz
	build/fuzz $(SECONDS) $(SEED)

build/fuzz: tests/fuzz.c pathtracer.h build/flags
	$(BUILD_C) -O1 -g -fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer \
	    tests/fuzz.c -o $@ $(LDLIBS)
