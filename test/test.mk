# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# The suites of `make test`, each also a target of its own. What a suite prints is what test/tally.py counts. It runs the gates of
# a suite (GATES.suite; else the suite is one) and the Python tests as they come, not one suite after the other.

##@ Suites of make test

SUITES   := check hidden-fixed hidden-fresh figures-check accuracy misra builds unit symbols warnings board gen-check cmock \
            python-sil python-gen python-training python-tools python-diagnosis python-exports python-filter python-install \
            python-manual
PYTHONS   = $(filter python-%,$(SUITES))
GATES     = $(foreach s,$(filter-out python-% packages,$(SUITES)),$(or $(GATES.$s),$s))
FOLDERS   = $(PYTHONS:python-%=test/%) $(patsubst %,test/%,$(filter packages,$(SUITES)))
MACHINES := $(shell . port/cortex-m/machines.sh && echo $$machines)
ALIKE    := mps2-an500 mps2-an505 # same compiler as mps2-an386, same instruction set but for reals; mps3-an547 has loops of its own
RUNTIME  := $(wildcard src/*.c)
MODEL    := $(wildcard gen/nqvm/c/*.c)
MODELS   := $(filter-out %_sets,$(patsubst gen/nqvm/c/%.h,%,$(wildcard gen/nqvm/c/*.h)))
LIBRARY  := $(RUNTIME) $(MODEL)
INCLUDE  := -Igen/nqvm/c -Ibuild/watched

.SECONDARY:
.PHONY: $(SUITES) python hidden hidden-nightly mujoco-nightly misra-long python-long
# A suite can also be called on its own; python is the last part of the set-up that one needs, unity aside.
READY := build/setup/python

# A compiler here is a command of the ports: all take the same options.
COMPILERS := gcc clang $(MACHINES)
CC.gcc    := port/host/cc gcc
CC.clang  := port/host/cc clang-19
$(foreach m,$(MACHINES),$(eval CC.$m := port/cortex-m/cc $m))

# -- objects: library and model for each compiler, type and level; `warnings` makes them, `symbols` looks into them, `unit` links them --

WARNINGS := -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion -Wmissing-prototypes \
            -Wstrict-prototypes -Wfloat-equal -Wcast-qual -Wcast-align -Wundef -Wswitch-enum -Wvla -Wredundant-decls \
            -Wwrite-strings -Werror
FIRMWARE := $(if $(MODEL),$(filter-out %/exact.c,$(wildcard sil/firmware/*.c)))
WATCHED  := build/watched/watched.h # with the rest of the C that sil/firmware/watch.c is written for
TOLD     := '-DMODEL_HEADER="nqvm.h"' '-DMODEL(name)=nqvm_\#\#name' '-DMODEL_SIZE(name)=NQVM_\#\#name' \
            '-DMODEL_SETS=&nqvm_set_default' -DBOARD_TICK_MHZ=25U -DEXACT_WIDTH=16U -Iport/xcp -Iport/cortex-m
BOARD.gcc   := $(wildcard port/host/*.c) sil/firmware/exact.c # which no target runs
BOARD.clang := $(BOARD.gcc)
$(foreach m,$(MACHINES),$(eval BOARD.$m := $(wildcard port/cortex-m/*.c)))
REAL.float  :=
REAL.double := -DPEN_REAL_DOUBLE -Wno-double-promotion
# The port for bare metal keeps gcc from calling memcpy; here it may try, `symbols` sees that it does not.
$(foreach m,$(MACHINES),$(eval TRIES.$m := -ftree-loop-distribute-patterns))
COMMANDS := test/test.mk $(wildcard port/*/cc) port/cortex-m/machines.sh # an object is made anew when they change

objects = $(patsubst %.c,build/objects/$(1)/%.o,$(2)) # (1) tree, (2) sources

# (1) tree, (2) command
define tree
build/objects/$(1)/%.o: %.c $(COMMANDS) | $(READY)
	@mkdir -p $$(@D)
	$(Q)$(2) $(INCLUDE) -MMD -MP -c -o $$@ $$<
endef
$(WATCHED): sil/filter/watched.toml sil/filter/quarter.toml $(wildcard gen/nqvm/*.toml) $(shell find gen/penode_gen -name '*.py' -o -name '*.j2') | $(READY)
	$(Q)$(PENODE) generate $< -o $(@D) >/dev/null # whole files, also where two gates of `make test` do it at once
LEVELS := -O2 -Os -O3
$(foreach c,$(COMPILERS),$(foreach r,float double,$(foreach l,$(LEVELS),$(eval \
    $(call tree,$c-$r$l,$(CC.$c) -std=c99 $l $(TRIES.$c) $(WARNINGS) $(REAL.$r) $(TOLD))))))

# -- no warning from any compiler, in float and in double -------------------------------------------------------------

GATES.warnings := $(COMPILERS:%=warnings-%-float) $(patsubst %,warnings-%-double,$(filter-out $(ALIKE),$(COMPILERS))) warnings-everything
warnings: $(GATES.warnings) ## Every compiler, strict, must be content

# (1) compiler, (2) float or double
define warnings
.PHONY: warnings-$(1)-$(2)
warnings-$(1)-$(2): $(call objects,$(1)-$(2)-O2,$(LIBRARY) $(FIRMWARE) $(BOARD.$(1)))
	@echo "ok    warnings $(1) $(2)"
$(call objects,$(1)-$(2)-O2,sil/firmware/watch.c): $(WATCHED)
endef
$(foreach c,$(COMPILERS),$(foreach r,float double,$(eval $(call warnings,$c,$r))))

# All that clang can say about library and model, but for its opinions on C99, padding, comments and plain arrays.
.PHONY: warnings-everything
warnings-everything: | $(READY)
	@test/check "warnings clang -Weverything" $(CC.clang) -std=c99 -fsyntax-only -Weverything -Werror -Wno-padded \
	    -Wno-documentation -Wno-declaration-after-statement -Wno-unsafe-buffer-usage $(INCLUDE) $(LIBRARY)

# -- no symbol from outside; on a core without FPU the compiler's own soft float --------------------------------------

ALLOWED.mps2-an385 := __aeabi_(f[a-z0-9]*|u?i2f)
# Cores that no port has. Most call memcpy for a copied struct sooner than a Cortex-M; clang needs no more than itself.
SOFT_FLOAT  := __gnu_thumb1_case_(uqi|sqi|uhi|shi|si)|__aeabi_(f[a-z0-9]*|u?i2f|u?i?divmod|u?idiv)|__(add|sub|mul|div|eq|ne|lt|le|gt|ge|unord)sf[23]|__float(un)?sisf|__fix(uns)?sfsi
CORES       := rv32 rv32-clang rv64 m0 m0plus-clang mips ppc s390x
CC.rv32     := riscv64-unknown-elf-gcc -march=rv32imac -mabi=ilp32
CC.rv32-clang   := clang-19 --target=riscv32-none-elf -march=rv32imc -mabi=ilp32
CC.rv64     := riscv64-unknown-elf-gcc
CC.m0       := arm-none-eabi-gcc -mcpu=cortex-m0 -mthumb
CC.m0plus-clang := clang-19 --target=thumbv6m-none-eabi -mcpu=cortex-m0plus
CC.mips     := clang-19 --target=mips-none-elf
CC.ppc      := clang-19 --target=ppc32-none-elf
CC.s390x    := s390x-linux-gnu-gcc -fexcess-precision=fast

GATES.symbols := $(foreach c,$(filter-out $(ALIKE),$(COMPILERS)),$(LEVELS:%=symbols-$c%)) $(ALIKE:%=symbols-%-O2) \
                 symbols-m0-O2 symbols-rv32-O2 $(CORES:%=symbols-%-Os)
symbols: $(GATES.symbols) ## Library and model must need nothing from outside

# (1) compiler, (2) optimisation, (3) tree of objects
define symbols
.PHONY: symbols-$(1)$(2)
symbols-$(1)$(2): $(call objects,$(3),$(LIBRARY))
	@test/check "symbols $(1) $(2)" test/symbols '$(ALLOWED.$(1))' $$^
endef
$(foreach c,$(COMPILERS),$(foreach l,$(LEVELS),$(eval $(call symbols,$c,$l,$c-float$l))))
$(foreach c,$(CORES),$(eval ALLOWED.$c := $(SOFT_FLOAT)))
$(foreach c,$(CORES),$(foreach l,-O2 -Os,\
    $(eval $(call tree,$c$l,$(CC.$c) -ffreestanding -Iinc -Iport/gnu -Wall -Wextra -Werror -std=c99 $l))$(eval $(call symbols,$c,$l,$c$l))))

# -- MISRA C:2012, as far as cppcheck's addon goes --------------------------------------------------------------------

# Each model with the runtime is a program; the example firmware belongs to the first.
PROGRAM.nqvm := $(wildcard sil/firmware/example.c)
HEADERS      := $(wildcard inc/penode/*.h) port/template/pen_port_target.h sil/firmware/board.h

# The runtime is read with the first model. The others, read against its headers, are programs of `make misra-long`.
FIRST := nqvm
GATES.misra := misra-gnuc misra-plain-$(FIRST) $(patsubst %,misra-model-%,$(filter-out $(FIRST),$(MODELS))) misra-watch misra-canary misra-table
misra: $(GATES.misra) ## cppcheck with its MISRA addon: nothing in the library, much in a bad file
GATES.misra-long := $(MODELS:%=misra-plain-%)
misra-long: $(GATES.misra-long) ## Each model with the whole runtime, as the program that it is part of

build/misra/%.c: gen/nqvm/c/%.h $(HEADERS) test/misra/every_entry
	@mkdir -p $(@D)
	$(Q)test/misra/every_entry $(filter %.h,$^) >$@

own_sources_of = build/misra/$(1).c gen/nqvm/c/$(1).c gen/nqvm/c/$(1)_selftest.c
SETS          := $(filter-out %_selftest.c,$(wildcard gen/nqvm/c/*_params.c))
misra-plain-%: build/misra/%.c | $(READY)
	@test/check "misra $*" test/misra/check clean $(call own_sources_of,$*) $(SETS) $(RUNTIME) $(PROGRAM.$*)
misra-model-%: build/misra/%.c | $(READY)
	@test/check "misra $*, without the runtime" test/misra/check clean $(call own_sources_of,$*)
misra-watch: $(WATCHED) $(HEADERS) test/misra/every_entry | $(READY) # the example with filter and monitor, and what is generated for it
	@mkdir -p build/misra
	$(Q)test/misra/every_entry build/watched/*.h $(HEADERS) >build/misra/watched.c
	@OPTIONS=-Ibuild/watched test/check "misra filter, monitor and their example" test/misra/check clean build/misra/watched.c \
	    build/watched/watched{,_selftest,_ekf,_monitor}.c sil/firmware/watch.c
misra-gnuc: build/misra/$(FIRST).c | $(READY) # the branches that only a compiler sees are in headers which any file reads
	@test/check "misra branches of compilers are in pen_exact.h, pen_real.h" test/misra/check compilers
	@OPTIONS='-D__GNUC__ -D__FP_FAST_FMA -D__OPTIMIZE_SIZE__ -D__thumb2__' test/check "misra -D__GNUC__" test/misra/check every $(call own_sources_of,$(FIRST))
	@test/check "misra every compiler" test/misra/check every $(call own_sources_of,$(FIRST))
misra-canary: | $(READY)
	@test/check "misra canary" test/misra/check canary test/misra/canary.c
misra-table: | $(READY)
	@test/check "misra table" $(PYTHON) test/misra/table.py

# -- the committed C is what the generator prints ---------------------------------------------------------------------

gen-check: | $(READY) ## The committed C must be, to the byte, what the generator makes of the model file
	@rm -rf build/gen-check
	@for model in $(MODELS); do \
	    test/check "gen-check $$model" $(PENODE) generate gen/nqvm/$$model.toml -o build/gen-check || exit; done
	@test/check "gen-check compare" diff -r build/gen-check gen/nqvm/c

# -- Unity: all files test/unit/test_*.c in one program for each variant -----------------------------------------------

# A variant is a compiler with options, and the way to run what it makes; "small" has the kernels of a size build.
FPUS        := $(filter-out mps2-an385,$(MACHINES))
VARIANTS    := $(COMPILERS) sanitize double small
CC.sanitize := port/host/cc gcc -g -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all
CC.double   := port/host/cc gcc -DPEN_REAL_DOUBLE
CC.small    := port/host/cc gcc
$(foreach v,gcc clang sanitize double small,$(eval RUN.$v := port/host/run gcc)$(eval OBJCOPY.$v := objcopy))
$(foreach m,$(MACHINES),$(eval RUN.$m := port/cortex-m/run $m)$(eval OBJCOPY.$m := arm-none-eabi-objcopy))
$(foreach m,$(MACHINES),$(eval LIBS.$m := -lc)) # Unity's setjmp
# Library and model of a variant are one of the trees above, but for those with sanitizers.
$(foreach c,$(COMPILERS),$(eval TREE.$c := $c-float-O2))
TREE.double   := gcc-double-O2
TREE.small    := gcc-float-Os
TREE.sanitize := sanitize
$(eval $(call tree,sanitize,$(CC.sanitize) -std=c99 -O1 -Wall -Wextra -Werror))

UNITS := $(patsubst test/unit/%.c,%,$(wildcard test/unit/test_*.c))
NEEDS := gen/nqvm/c/nqvm.c gen/nqvm/c/nqvm_params.c gen/nqvm/c/nqvm_selftest.c
KERNELS := test_pen_net test_pen_net16
UNIT_CFLAGS := -std=c99 -O1 -Wall -Wextra -Werror $(INCLUDE) -I. -Itest/unit -Ibuild/unity/src -include unity_config.h

# Tests without arithmetic on reals are left out on cores with the instruction set of another. Those: cores-long.
INTEGERS := $(filter test_pen_recover test_pen_saved test_pen_serial test_pen_set test_pen_set_staging test_pen_status test_pen_xcp% test_xcp_frame,$(UNITS))
GATES.unit := $(VARIANTS:%=unit-%) $(FPUS:%=unit-%-kernels)
.PHONY: cores-long
GATES.cores-long := $(ALIKE:%=unit-%-integers) $(ALIKE:%=warnings-%-double) $(ALIKE:%=symbols-%-Os) $(ALIKE:%=symbols-%-O3)
cores-long: $(GATES.cores-long) ## What suites leave out on cores that are like others
unit: $(GATES.unit) ## The C unit tests, on this machine and on the emulated ones; FILES="test_pen_set ..." takes some of them

build/unit/runner/%.c: test/unit/%.c build/setup/unity
	@mkdir -p $(@D)
	$(Q)ruby build/unity/auto/generate_test_runner.rb --main_name=main_$* $< $@
	$(Q)sed -i '1i #include "$<"\n#undef RUN_TEST' $@

# A file and its runner are one object in which all but the runner's entry is static: files may use the same names.
# (1) variant
define objects_of_variant
build/unit/$(1)/%.o: build/unit/runner/%.c $(COMMANDS)
	@mkdir -p $$(@D)
	$(Q)$(CC.$(1)) $(UNIT_CFLAGS) -MMD -MP -c -o $$@ $$<
	$(Q)$(OBJCOPY.$(1)) --keep-global-symbol=main_$$* $$@
build/unit/$(1)/unity/%.o: build/unity/src/%.c build/setup/unity $(COMMANDS)
	@mkdir -p $$(@D)
	$(Q)$(CC.$(1)) $(UNIT_CFLAGS) -c -o $$@ $$<
build/unit/$(1)/unity_output.o: test/unit/unity_output.c build/setup/unity $(COMMANDS)
	@mkdir -p $$(@D)
	$(Q)$(CC.$(1)) $(UNIT_CFLAGS) -MMD -MP -c -o $$@ $$<
endef
$(foreach v,$(VARIANTS),$(eval $(call objects_of_variant,$v)))

# (1) target, (2) variant, (3) files, (4) tree of objects, (5) sources of it
define unit
build/unit/$(2)/$(1): test/unit/main.c $(patsubst %,build/unit/$(2)/%.o,$(3) unity/unity unity_output) $(call objects,$(4),$(5))
	$(Q)$(CC.$(2)) $(UNIT_CFLAGS) '-DUNITS=$(foreach t,$(3),UNIT($t))' -o $$@ $$^ $(LIBS.$(2))
.PHONY: $(1)
$(1): build/unit/$(2)/$(1)
	@test/unit/show $(1:unit-%=%) $(RUN.$(2)) $$< -- $$(or $$(filter $$(FILES),$(3)),$(3))
endef
$(foreach v,$(VARIANTS),$(eval $(call unit,unit-$v,$v,$(if $(filter $v,$(ALIKE)),$(filter-out $(INTEGERS),$(UNITS)),$(UNITS)),$(TREE.$v),$(RUNTIME) $(NEEDS))))
$(foreach m,$(ALIKE),$(eval $(call unit,unit-$m-integers,$m,$(INTEGERS),$m-float-O2,$(RUNTIME))))
$(foreach m,$(FPUS),$(eval $(call unit,unit-$m-kernels,$m,$(KERNELS),$m-float-Os,$(filter src/pen_net% src/pen_math.c,$(RUNTIME)))))
-include $(shell find build/objects build/unit -name '*.d' 2>/dev/null)

# -- the ports themselves ---------------------------------------------------------------------------------------------

GATES.board := $(MACHINES:%=board-%)
board: $(GATES.board) ## Each emulated machine: counts, stack, files, interrupt, fault reports
board-%: | $(READY)
	@test/board/check.sh $*

# -- the port mocked --------------------------------------------------------------------------------------------------

cmock: build/setup/unity build/setup/cmock ## The order in which the library uses the port
	@test/cmock/run

# -- elementary functions against wider arithmetic --------------------------------------------------------------------

STRIDE := 64 # 1: all 2^32 floats, five minutes
ACCURACY := -std=c99 -O2 -ffp-contract=off -Iinc -Iport/gnu

GATES.accuracy := accuracy-float accuracy-double accuracy-source accuracy-elementary
accuracy: $(GATES.accuracy) ## Error of exp, tanh, sigmoid, softplus; STRIDE=1 takes all floats

build/accuracy:
	@mkdir -p $@
.PHONY: accuracy-float accuracy-double accuracy-source
accuracy-float: | build/accuracy $(READY)
	$(Q)gcc $(ACCURACY) -pthread -o build/accuracy/float test/accuracy/pen_math_accuracy.c src/pen_math.c -lm
	@test/check "accuracy float, every $(strip $(STRIDE)). number" build/accuracy/float $(STRIDE) 2
accuracy-double: | build/accuracy $(READY)
	$(Q)gcc $(ACCURACY) -DPEN_REAL_DOUBLE -shared -fPIC -o build/accuracy/double.so src/pen_math.c
	@test/check "accuracy double, dense sample" $(PYTHON) test/accuracy/double_error.py build/accuracy/double.so
accuracy-source: | $(READY)
	@test/check "accuracy coefficients are the derived ones" $(PYTHON) test/accuracy/coefficients.py --check src/pen_math.c
include test/accuracy/elementary.mk

# -- Python: generator, simulation, and this tally --------------------------------------------------------------------

python: $(PYTHONS) ## The Python tests
$(PYTHONS): python-%: | $(READY)
	@HYPOTHESIS_STORAGE_DIRECTORY=build/hypothesis OPENBLAS_NUM_THREADS=1 $(PYTHON) -m pytest -q --durations=12 --durations-min=5 test/$* # one thread each: parts run side by side
python-long: | $(READY) ## The Python tests of which `make test` takes a sample: the others
	@PENODE_LONG=1 $(PYTHON) -m pytest -q test/gen/test_emit.py test/gen/test_selftest.py
	@for part in gen sil tools exports training diagnosis; do OPENBLAS_NUM_THREADS=1 $(PYTHON) -m pytest -q -m long test/$$part || exit; done

# -- hidden effects: a draw that never changes, and one that nobody has seen --------------------------------------------

HIDDEN := OPENBLAS_NUM_THREADS=1 $(PYTHON) test/diagnosis/campaign.py --brief --gate --fork --command "penode diagnose"

hidden: hidden-fixed hidden-fresh ## The diagnosis has to find what recordings hide; a right program fails less than once in 1000 runs
hidden-fixed: | $(READY)
	@$(HIDDEN) --cases 12 --seed 1 --out build/campaign/fixed
hidden-fresh: | $(READY)
	@$(HIDDEN) --cases 4 --out build/campaign/fresh
hidden-nightly: | $(READY)
	@$(HIDDEN) --cases 24 --out build/campaign/nightly
mujoco-nightly: build/setup/mujoco
	@OPENBLAS_NUM_THREADS=1 $(PYTHON) test/diagnosis/mujoco_cases/mujoco_campaign.py --cases 12 --gate --out build/mujoco-cases/nightly

# -- the price ----------------------------------------------------------------------------------------------------------

figures-check: | $(READY) ## No figure may be 2 % worse than the kept one, or above what is promised
	@test/check "figures" $(PYTHON) test/bench/bench.py --check
	@test/check "figures of filters" $(PYTHON) test/bench/filters.py --check

# -- packages for firmware ------------------------------------------------------------------------------------------------

include test/packages/packages.mk
include test/builds/builds.mk
include test/exports/exports.mk
