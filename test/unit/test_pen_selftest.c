/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* needs: gen/nqvm/c/nqvm.c gen/nqvm/c/nqvm_params.c gen/nqvm/c/nqvm_selftest.c */

/* The self-test passes on every machine, and reports each mode of its floating-point unit that breaks the contract. What
   takes another build (contraction, another real type in the library, a changed kernel) is in test/gen/test_selftest.py. */

#include <stddef.h>
#include <stdint.h>

#include "nqvm.h"
#include "penode/pen_selftest.h"
#include "unity.h"

static nqvm_t model;

/* The control register of the floating-point unit; a core without one has no modes that could be wrong. */
#if defined(__x86_64__)
#define MODES          1
#define FLUSH_RESULTS  0x8000U
#define FLUSH_OPERANDS 0x0040U
#define DOWN           0x2000U
#define UP             0x4000U
#define ZERO           0x6000U

static uint32_t mode(void)
{
    return __builtin_ia32_stmxcsr();
}
static void set_mode(uint32_t word)
{
    __builtin_ia32_ldmxcsr(word);
}

#elif defined(__ARM_FP)
#define MODES          1
#define FLUSH_RESULTS  0x01000000U
#define FLUSH_OPERANDS 0x01000000U
#define UP             0x00400000U
#define DOWN           0x00800000U
#define ZERO           0x00c00000U

static uint32_t mode(void)
{
    uint32_t word;
    __asm__ volatile("vmrs %0, fpscr" : "=r"(word));
    return word;
}

static void set_mode(uint32_t word)
{
    __asm__ volatile("vmsr fpscr, %0" : : "r"(word));
}

#else
#define MODES          0
#define FLUSH_RESULTS  0U
#define FLUSH_OPERANDS 0U
#define UP             0U
#define DOWN           0U
#define ZERO           0U

static uint32_t mode(void)
{
    return 0U;
}
static void set_mode(uint32_t word)
{
    (void)word;
}
#endif

void setUp(void) {}
void tearDown(void) {}

typedef struct {
    uint32_t runtime;
    uint32_t model;
} found_t;

/* What is found while some bits of the control register are set. */
static found_t found_with(uint32_t bits)
{
    const uint32_t before = mode();
    found_t found;

    set_mode(before | bits);
    found.runtime = pen_selftest();
    found.model = nqvm_selftest(&model);
    set_mode(before);
    return found;
}

/* `flag` and nothing but the answers that it spoils. */
static void expect(uint32_t flag, found_t found)
{
    if (MODES == 1) {
        TEST_ASSERT_EQUAL_HEX32(flag, found.runtime & ~PEN_SELFTEST_ANSWER);
        TEST_ASSERT_EQUAL_HEX32(flag, found.model & ~PEN_SELFTEST_ANSWER);
    } else {
        TEST_ASSERT_EQUAL_HEX32(0U, found.runtime | found.model);
    }
}

void test_a_good_build_passes(void)
{
    TEST_ASSERT_EQUAL_HEX32(0U, pen_selftest());
    TEST_ASSERT_EQUAL_HEX32(0U, nqvm_selftest(&model));
    TEST_ASSERT_EQUAL_HEX32(0U, nqvm_selftest(&model)); /* and leaves nothing that spoils the next one */
}

void test_flush_to_zero_is_reported(void)
{
    expect(PEN_SELFTEST_FLUSH, found_with(FLUSH_RESULTS));
    expect(PEN_SELFTEST_FLUSH, found_with(FLUSH_OPERANDS));
    expect(PEN_SELFTEST_FLUSH, found_with(FLUSH_RESULTS | FLUSH_OPERANDS));
}

void test_every_other_rounding_mode_is_reported(void)
{
    expect(PEN_SELFTEST_ROUNDING, found_with(UP));
    expect(PEN_SELFTEST_ROUNDING, found_with(DOWN));
    expect(PEN_SELFTEST_ROUNDING, found_with(ZERO));
    expect(PEN_SELFTEST_ROUNDING | PEN_SELFTEST_FLUSH, found_with(ZERO | FLUSH_RESULTS | FLUSH_OPERANDS));
}

void test_another_real_type_is_reported_and_nothing_is_written(void)
{
    const uint32_t other = PEN_SELFTEST_TYPE ^ 12U; /* 4 bytes for 8, or 8 for 4 */

    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_REAL, pen_selftest_of(other));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_REAL, nqvm_selftest_of(&model, other));
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_REAL | PEN_SELFTEST_BADARG, nqvm_selftest_of(NULL, other));
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_BADARG, nqvm_selftest(NULL));
    nqvm_x_t x;
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_get_state(&model, &x)); /* as it was */
}

void test_the_lent_instance_has_to_be_initialised_again(void)
{
    const nqvm_u_t u = { (pen_real_t)0 };
    nqvm_y_t y;

    TEST_ASSERT_EQUAL_HEX32(0U, nqvm_selftest(&model));
    TEST_ASSERT_EQUAL_HEX32(PEN_BADARG, nqvm_step(&model, &u, &y));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_init(&model, &nqvm_set_default, NULL));
    TEST_ASSERT_EQUAL_HEX32(PEN_OK, nqvm_step(&model, &u, &y));
}

/* FNV-1a of the bytes of 1.0, low byte first: the standard's constants, by hand in test/gen/test_selftest.py. */
void test_the_hash_is_that_of_the_bytes_low_byte_first(void)
{
    const pen_real_t one = (pen_real_t)1;

    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_SEED, pen_selftest_hash(PEN_SELFTEST_SEED, 0U, &one));
    TEST_ASSERT_EQUAL_HEX32((sizeof(pen_real_t) == 4U) ? 0x1b587698U : 0x8c6a9878U, pen_selftest_hash(PEN_SELFTEST_SEED, 1U, &one));
}

/* What only a contracted file computes, in each of the two forms; and what another rounding mode makes of them is something else. */
void test_one_rounding_instead_of_two(void)
{
    const pen_real_t zero = (pen_real_t)0;
    const pen_real_t square = PEN_REAL_EPSILON * PEN_REAL_EPSILON;
    const pen_real_t large = PEN_REAL_EPSILON;

    TEST_ASSERT_EQUAL_HEX32(0U, pen_selftest_contracted());
    TEST_ASSERT_EQUAL_HEX32(0U, pen_selftest_fused(zero, zero));
    TEST_ASSERT_EQUAL_HEX32(0U, pen_selftest_fused(large, -large));
    TEST_ASSERT_EQUAL_HEX32(0U, pen_selftest_fused(-square, square));
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_CONTRACTED, pen_selftest_fused(square, zero));
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_CONTRACTED, pen_selftest_fused(zero, -square));
    TEST_ASSERT_EQUAL_HEX32(PEN_SELFTEST_CONTRACTED, pen_selftest_fused(square, -square));
}
