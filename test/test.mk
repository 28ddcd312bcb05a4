# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# The suites of `make test`, each also a target of its own. What a suite prints is what test/tally.py counts.

# Each takes one core there; the longest begin, so that none runs on alone.
SUITES   := python-sil hidden-fixed hidden-fresh figures-check python-gen unit warnings misra accuracy python-tools \
            python-diagnosis python-training python-exports python-install symbols builds board gen-check cmock
PYTHONS  := $(filter python-%,$(SUITES))
MACHINES := $(shell . port/cortex-m/machines.sh && echo $$machines)
ALIKE    := mps2-an500 mps2-an505 # same compiler as mps2-an386, same instruction set but for reals; mps3-an547 has loops of its own
RUNTIME  := $(wildcard src/*.c)
MODEL    := $(wildcard gen/nqvm/c/*.c)
MODELS   := $(filter-out %_sets,$(patsubst gen/nqvm/c/%.h,%,$(wildcard gen/nqvm/c/*.h)))
LIBRARY  := $(RUNTIME) $(MODEL)
INCLUDE  := -Igen/nqvm/c

.SECONDARY:
.PHONY: $(SUITES) python hidden misra-long python-long
# A suite can also be called on its own; python is the last part of the set-up that one needs, unity aside.
READY := build/setup/python

# A compiler here is a command of the ports: all take the same options.
COMPILERS := gcc clang $(MACHINES)
CC.gcc    := port/host/cc gcc
CC.clang  := port/host/cc clang-19
$(foreach m,$(MACHINES),$(eval CC.$m := port/cortex-m/cc $m))

# -- no warning from any compiler, in float and in double -------------------------------------------------------------

WARNINGS := -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion -Wmissing-prototypes \
            -Wstrict-prototypes -Wfloat-equal -Wcast-qual -Wcast-align -Wundef -Wswitch-enum -Wvla -Wredundant-decls \
            -Wwrite-strings -Werror
FIRMWARE := $(if $(MODEL),$(wildcard sil/firmware/*.c))
TOLD     := '-DMODEL_HEADER="nqvm.h"' '-DMODEL(name)=nqvm_\#\#name' '-DMODEL_SIZE(name)=NQVM_\#\#name' \
            '-DMODEL_SETS=&nqvm_set_default' -DBOARD_TICK_MHZ=25U -Iport/xcp -Iport/cortex-m
BOARD.gcc   := $(wildcard port/host/*.c)
BOARD.clang := $(BOARD.gcc)
$(foreach m,$(MACHINES),$(eval BOARD.$m := $(wildcard port/cortex-m/*.c)))

warnings: $(COMPILERS:%=warnings-%-float) $(patsubst %,warnings-%-double,$(filter-out $(ALIKE),$(COMPILERS))) warnings-everything ## Every compiler, strict, must be content

REAL.float  :=
REAL.double := -DPEN_REAL_DOUBLE -Wno-double-promotion

# (1) compiler, (2) float or double
define warnings
.PHONY: warnings-$(1)-$(2)
warnings-$(1)-$(2): | $(READY)
	@test/check "warnings $(1) $(2)" test/each $(CC.$(1)) -std=c99 -O2 $(WARNINGS) $(REAL.$(2)) $(INCLUDE) $(TOLD) \
	    -c -o /dev/null -- $(RUNTIME) $(MODEL) $(FIRMWARE) $(BOARD.$(1))
endef
$(foreach c,$(COMPILERS),$(foreach r,float double,$(eval $(call warnings,$c,$r))))

# All that clang can say about library and model, but for its opinions on C99, padding, comments and plain arrays.
.PHONY: warnings-everything
warnings-everything: | $(READY)
	@test/check "warnings clang -Weverything" test/each $(CC.clang) -std=c99 -O2 -Weverything -Werror -Wno-padded \
	    -Wno-documentation -Wno-declaration-after-statement -Wno-unsafe-buffer-usage $(INCLUDE) -c -o /dev/null -- $(LIBRARY)

# -- no symbol from outside; on a core without FPU the compiler's own soft float --------------------------------------

ALLOWED.mps2-an385 := __aeabi_(f[a-z0-9]*|u?i2f)
LEVELS := -O2 -Os -O3

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

symbols: $(foreach c,$(filter-out $(ALIKE),$(COMPILERS)),$(foreach l,$(LEVELS),symbols-$c$l)) $(ALIKE:%=symbols-%-O2) symbols-m0-O2 symbols-rv32-O2 $(CORES:%=symbols-%-Os) ## Library and model must need nothing from outside

# (1) compiler, (2) optimisation; the port for bare metal keeps gcc from calling memcpy, here it may try
define symbols
.PHONY: symbols-$(1)$(2)
symbols-$(1)$(2): | $(READY)
	@test/check "symbols $(1) $(2)" test/symbols '$(ALLOWED.$(1))' $(CC.$(1)) -std=c99 $(2) \
	    $(if $(filter $(1),$(MACHINES)),-ftree-loop-distribute-patterns) $(INCLUDE) $(LIBRARY)
endef
$(foreach c,$(COMPILERS),$(foreach l,$(LEVELS),$(eval $(call symbols,$c,$l))))
$(foreach c,$(CORES),$(eval ALLOWED.$c := $(SOFT_FLOAT))$(eval CC.$c += -ffreestanding -Iinc -Iport/gnu -Wall -Wextra -Werror))
$(foreach c,$(CORES),$(foreach l,-O2 -Os,$(eval $(call symbols,$c,$l))))

# -- MISRA C:2012, as far as cppcheck's addon goes --------------------------------------------------------------------

# Each model with the runtime is a program; the example firmware belongs to the first.
PROGRAM.nqvm := $(wildcard sil/firmware/example.c)
HEADERS      := $(wildcard inc/penode/*.h) port/template/pen_port_target.h sil/firmware/board.h

# The runtime is read with the first model. The others, read against its headers, are programs of `make misra-long`.
FIRST := nqvm
misra: misra-plain-$(FIRST) $(patsubst %,misra-model-%,$(filter-out $(FIRST),$(MODELS))) misra-gnuc misra-canary misra-table ## cppcheck with its MISRA addon: nothing in the library, much in a bad file
misra-long: $(MODELS:%=misra-plain-%) ## Each model with the whole runtime, as the program that it is part of

build/misra/%.c: gen/nqvm/c/%.h $(HEADERS) test/misra/every_entry
	@mkdir -p $(@D)
	$(Q)test/misra/every_entry $(filter %.h,$^) >$@

own_sources_of = build/misra/$(1).c gen/nqvm/c/$(1).c gen/nqvm/c/$(1)_selftest.c
SETS          := $(filter-out %_selftest.c,$(wildcard gen/nqvm/c/*_params.c))
misra-plain-%: build/misra/%.c | $(READY)
	@test/check "misra $*" test/misra/check clean $(call own_sources_of,$*) $(SETS) $(RUNTIME) $(PROGRAM.$*)
misra-model-%: build/misra/%.c | $(READY)
	@test/check "misra $*, without the runtime" test/misra/check clean $(call own_sources_of,$*)
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

# -- Unity: every test/unit/test_*.c is a program, built and run in every variant -------------------------------------

# A variant is a compiler with options, and the way to run what it makes; "small" has the kernels of a size build.
FPUS        := $(filter-out mps2-an385,$(MACHINES))
VARIANTS    := $(COMPILERS) sanitize double small
CC.sanitize := port/host/cc gcc -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all
CC.double   := port/host/cc gcc -DPEN_REAL_DOUBLE
CC.small    := port/host/cc gcc
LEVEL.small := -Os
$(foreach v,gcc clang sanitize double small,$(eval RUN.$v := port/host/run gcc))
$(foreach m,$(MACHINES),$(eval RUN.$m := port/cortex-m/run $m))
$(foreach m,$(MACHINES),$(eval LIBS.$m := -lc)) # Unity's setjmp
$(foreach m,$(FPUS),$(foreach k,CC RUN LIBS,$(eval $k.small-$m := $($k.$m)))$(eval LEVEL.small-$m := -Os))

KERNELS := test_pen_net test_pen_net16
UNITS   := $(patsubst test/unit/%.c,%,$(wildcard test/unit/test_*.c))
$(foreach t,$(UNITS),$(eval NEEDS.$t := $(shell sed -n 's|.*needs: \(.*\) \*/.*|\1|p' test/unit/$t.c))) # read once, not for each variant
objects  = $(patsubst %.c,build/unit/$(1)/%.o,$(2))
UNIT_CFLAGS := -std=c99 -g -Wall -Wextra -Werror $(INCLUDE) -Itest/unit -Ibuild/unity/src -include unity_config.h

# Tests without arithmetic on reals are left out on cores with the instruction set of another. Those: cores-long.
INTEGERS := $(filter test_pen_recover test_pen_saved test_pen_serial test_pen_set test_pen_set_staging test_pen_status test_pen_xcp% test_xcp_frame,$(UNITS))
UNIT_LONG := $(foreach v,$(ALIKE),$(INTEGERS:%=unit-$v-%))
.PHONY: cores-long
cores-long: $(UNIT_LONG) $(ALIKE:%=warnings-%-double) $(ALIKE:%=symbols-%-Os) $(ALIKE:%=symbols-%-O3) ## What suites leave out on cores that are like others
unit: $(filter-out $(UNIT_LONG),$(foreach v,$(VARIANTS),$(UNITS:%=unit-$v-%)) $(foreach t,$(KERNELS),$(FPUS:%=unit-small-%-$t))) ## The C unit tests, on this machine and on the emulated ones

build/unit/runner/%.c: test/unit/%.c build/setup/unity
	@mkdir -p $(@D)
	$(Q)ruby build/unity/auto/generate_test_runner.rb $< $@

# (1) variant
define objects_of_variant
build/unit/$(1)/%.o: %.c build/setup/unity
	@mkdir -p $$(@D)
	$(Q)$(CC.$(1)) $(or $(LEVEL.$(1)),-O2) $(UNIT_CFLAGS) -MMD -c -o $$@ $$<
endef

# (1) variant, (2) test
define unit
build/unit/$(1)/$(2): $(call objects,$(1),build/unit/runner/$(2).c test/unit/$(2).c test/unit/unity_output.c \
                                          build/unity/src/unity.c $(RUNTIME) $(NEEDS.$(2)))
	$(Q)$(CC.$(1)) -O2 -o $$@ $$^ $(LIBS.$(1))
.PHONY: unit-$(1)-$(2)
unit-$(1)-$(2): build/unit/$(1)/$(2)
	@test/unit/show $(2) $(1) $(RUN.$(1)) $$<
endef

$(foreach v,$(VARIANTS) $(FPUS:%=small-%),$(eval $(call objects_of_variant,$v)))
$(foreach v,$(VARIANTS),$(foreach t,$(UNITS),$(eval $(call unit,$v,$t))))
$(foreach m,$(FPUS),$(foreach t,$(KERNELS),$(eval $(call unit,small-$m,$t))))
-include $(shell find build/unit -name '*.d' 2>/dev/null)

# -- the ports themselves ---------------------------------------------------------------------------------------------

board: $(MACHINES:%=board-%) ## Each emulated machine: counts, stack, files, interrupt, fault reports
board-%: | $(READY)
	@test/board/check.sh $*

# -- the port mocked --------------------------------------------------------------------------------------------------

cmock: build/setup/unity build/setup/cmock ## The order in which the library uses the port
	@test/cmock/run

# -- elementary functions against wider arithmetic --------------------------------------------------------------------

STRIDE := 64 # 1: all 2^32 floats, five minutes
ACCURACY := -std=c99 -O2 -ffp-contract=off -Iinc -Iport/gnu

accuracy: accuracy-float accuracy-double accuracy-source accuracy-elementary ## Error of exp, tanh, sigmoid, softplus; STRIDE=1 takes all floats

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
	@PENODE_LONG=1 $(PYTHON) -m pytest -q test/gen/test_emit.py
	@for part in gen sil tools exports training; do OPENBLAS_NUM_THREADS=1 $(PYTHON) -m pytest -q -m long test/$$part || exit; done

# -- hidden effects: a draw that never changes, and one that nobody has seen --------------------------------------------

HIDDEN := $(PYTHON) test/diagnosis/campaign.py --cases 12 --brief --gate --command "$(PENODE) diagnose"

hidden: hidden-fixed hidden-fresh ## The diagnosis has to find what recordings hide; a right program fails less than once in 1000 runs
hidden-fixed: | $(READY)
	@$(HIDDEN) --seed 1 --out build/campaign/fixed
hidden-fresh: | $(READY)
	@$(HIDDEN) --out build/campaign/fresh

# -- the price ----------------------------------------------------------------------------------------------------------

figures-check: | $(READY) ## No figure may be 2 % worse than the kept one, or above what is promised
	@test/check "figures" $(PYTHON) test/bench/bench.py --check

# -- packages for firmware ------------------------------------------------------------------------------------------------

include test/packages/packages.mk
include test/builds/builds.mk
include test/exports/exports.mk
