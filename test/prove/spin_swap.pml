/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * src/pen_set.c with its two contexts, for Spin: the tuning context here, the step in spin_step.pml; spin_memory.pml is how
 * each sees the other's stores. An inline has the name of the C function that it stands for, and each of its lines ends in
 * the C line that it is (spin_check.py compares the two, so that neither can change alone). What is folded when a set is
 * published belongs to the generated code; here it is one word for each slot.
 *
 * Memory. WEAK: a store lies with its writer, then in memory, then is seen by the other context; it goes on at any time,
 * in any order, and only a barrier of the one who waits forces it. So stores come late and out of order, and loads see
 * old values. `active` and `pending`, which decide what is done next, are carried by a process. What the step only reads
 * is not: it is looked at in all three places, any of which the step may see. Without WEAK every store is seen at once:
 * any interleaving of two contexts on one core, whichever pre-empts the other. Words are whole (pen_port.h), everything
 * larger is not. Not modelled: a load that takes its value from a store that comes after it in the program.
 *
 * The tuning context makes any calls, without end, in any order, with good and bad values; the step runs forever. The
 * states are finite, so all of them are looked at: a set is known by an id, which comes back once nothing has it.
 * SELECT: only select, rollback and withdraw. What is staged plays no part in whether a set is adopted, so `answered`,
 * which takes many times more states, is shown with these.
 * A MUTANT is the protocol with one fault; spin_check.py lists them. Each must be caught by an assertion or by `answered`.
 */

#ifndef MUTANT
#define MUTANT 0
#endif
#define IF(mutant, faulty, right) if :: MUTANT == mutant -> faulty :: else -> right fi

/* With WEAK the stores of a block may be made at once: what is on its way may have come late. */
#ifdef WEAK
#define TOGETHER d_step
#else
#define TOGETHER
#endif

#define NO  0
#define YES 1

#include "spin_memory.pml"

/* ---- what must hold: told by counting, not by the protocol ---- */

bool waiting;      /* a set is published, and neither adopted nor withdrawn */
bool asked;        /* its withdrawal has been requested                     */
bool granted;      /* the step has reported that it is withdrawn            */
bool could_return; /* there was a rollback set before it was published      */
byte id_waiting, id_now, id_before; /* before: of the set that ran before that */

/* a committed set is adopted or, if that was requested, withdrawn; then another may be published */
#define unanswered (waiting || pending != NOTHING)
ltl answered { [] (unanswered -> <> !unanswered) }

/* ---- pen_set.c, tuning context ---- */

inline pen_tuning_inactive()
{
    slot = seen[ACTIVE] ^ 1; // return (pen_port_load(&tuning->active) & 1U) ^ 1U;
}

inline pen_tuning_pending()
{
    good = (load_pending_tuner != NOTHING);       // return pen_port_load(&tuning->pending) != 0U;
}

inline pen_tuning_settle()
{
    d_step {
        pen_tuning_pending();
        good = !good                              // const bool done = !pen_tuning_pending(tuning);
    }
    IF(4, skip, barrier_of_tuner());              // pen_port_barrier();
    d_step {
        if
        :: good && published != 0 ->              // if (done && (tuning->published != 0U)) {
            slot = seen[ACTIVE];                  // const uint32_t active = pen_port_load(&tuning->active) & 1U;
            assert(!waiting);
            assert(slot == mine[ACTIVE]);
            if
            :: published == ADOPT + (slot ^ 1) ->    // if (tuning->published == command(ADOPT, active ^ 1U)) {
                assert(granted);
                if :: MUTANT != 27 -> previous_id = replaced_id :: else fi; // pen_set_copy(&tuning->previous, &tuning->replaced);
                if :: MUTANT != 27 -> previous_value = replaced_value :: else fi;
                assert(!could_return || (previous_value != NOWHERE && previous_id == id_before))
            :: else ->
                assert(!granted && mine[ID(slot)] == id_now) /* it is in force, also if its withdrawal was overtaken */
            fi;
            skip;                                 // tuning->settled = active;
            published = 0;                        // tuning->published = 0U;
            replaced_id = 0;
            replaced_value = NOWHERE;
            asked = false;
            granted = false;
            could_return = false
        :: else
        fi
    }
}

inline pen_tuning_publish()
{
    TOGETHER {
    pen_tuning_inactive();                        // const uint32_t slot = pen_tuning_inactive(tuning);
    /* the generated code has folded for this slot already */
    IF(19, store(PIECES(slot ^ 1), ready_id), store(PIECES(slot), ready_id));
    IF(9, store_pending_of_tuner(ADOPT + slot), skip);
    store(ID(slot), ready_id);                    // pen_set_copy(&tuning->slot[slot], ready);
    store(VALUE(slot), ready_value);
    skip; /* what only verify reads */            // pen_set_copy(&tuning->slot_check[slot], ready);
    d_step {
    IF(30, replaced_id = mine[ID(slot ^ 1)],
           replaced_id = previous_id);            // pen_set_copy(&tuning->replaced, &tuning->previous);
    IF(30, replaced_value = mine[VALUE(slot ^ 1)], replaced_value = previous_value);
    could_return = (previous_value != NOWHERE);
    IF(12, previous_id = ready_id,
           previous_id = mine[ID(slot ^ 1)]);     // pen_set_copy(&tuning->previous, &tuning->slot[slot ^ 1U]);
    IF(12, previous_value = ready_value, previous_value = mine[VALUE(slot ^ 1)]);
    open = NO;                                    // tuning->open = NO;
    dropped = true;
    published = ADOPT + slot                      // tuning->published = command(ADOPT, slot);
    }
    }
    IF(1, skip, barrier_of_tuner());              // pen_port_barrier();
    atomic {
        assert(!waiting); /* none is published over one that waits */
        waiting = true;
        id_waiting = ready_id;
        IF(15, skip, IF(9, skip, store_pending_of_tuner(published))); // pen_port_store(&tuning->pending, tuning->published);
    }
}

inline pen_tuning_withdraw()
{
    target = (published == ADOPT + 1 -> 1 : 0);   // const uint32_t slot = (tuning->published == command(ADOPT, 1U)) ? 1U : 0U;
    IF(24, good = false, pen_tuning_settle());    // if (pen_tuning_settle(tuning)) {
    if
    :: good
    :: !good && (load_pending_tuner == ADOPT + target || /* asked for once only */
                 MUTANT == 24 || MUTANT == 26) -> // } else if (pen_port_load(&tuning->pending) == command(ADOPT, slot)) {
        atomic { /* the step may have adopted it since */
            asked = true;
            IF(21, store_pending_of_tuner(CLEARED),
                   store_pending_of_tuner(WITHDRAW + target)) // pen_port_store(&tuning->pending, command(WITHDRAW, slot));
        }
    :: else
    fi;
    target = 0
}

inline pen_set_check(id, value)
{
    d_step {
        if
        :: value >= FLASH -> good = true
        :: else -> good = (mine[WORD(value, 0)] == id) && (mine[WORD(value, 1)] == id) || MUTANT == 16
        fi
    }
}

inline pen_tuning_begin()
{
    IF(5, good = true, pen_tuning_settle());      // } else if (!pen_tuning_settle(tuning)) {
    if
    :: good ->
        TOGETHER {
        d_step {
            pen_tuning_inactive();                // const uint32_t slot = pen_tuning_inactive(tuning);
            staging = mine[VALUE(slot ^ 1)];      // const pen_real_t *const running = tuning->slot[slot ^ 1U].value;
            if
            :: MUTANT == 10 -> staging = BANK0
            :: MUTANT != 10 && staging != BANK0 && // const bool first = (tuning->bank[0] != running) &&
               (previous_value != BANK0 ||         // ((tuning->bank[0] != tuning->previous.value) || (tuning->bank[1] == running));
                staging == BANK1) -> staging = BANK0
            :: else -> staging = BANK1            // const uint32_t bank = first ? 0U : 1U;
            fi;
            if
            :: previous_value == staging && MUTANT != 11 -> // if (tuning->previous.value == tuning->bank[bank]) {
                /* given up only if it must be */
                assert(mine[VALUE(slot ^ 1)] + previous_value == BANK0 + BANK1);
                previous_id = 0;
                previous_value = NOWHERE          // tuning->previous.value = NULL;
            :: else
            fi;
            mine[WORD(staging, 0)] = BAD; memory[WORD(staging, 0)] = BAD; seen[WORD(staging, 0)] = BAD;
            mine[WORD(staging, 1)] = BAD; memory[WORD(staging, 1)] = BAD; seen[WORD(staging, 1)] = BAD;
            id = 1; /* one that no set has; what is left in the bank has none any more */
            do
            :: id == mine[ID(slot ^ 1)] || id == previous_id -> id++
            :: else -> break
            od
        }
        store(ID(slot), id);                      // copy_head(&tuning->slot[slot].head, head);
        store(VALUE(slot), staging);              // tuning->slot[slot].value = tuning->bank[bank];
        d_step {
        fill = 0;                                 // tuning->fill = 0U;
        dropped = false;
        open = YES                                // tuning->open = YES;
        }
        }
    :: else
    fi
}

/* A copy of the running set. Only its source matters here, not its values. */
inline pen_tuning_begin_copy()
{
    if :: copy = NO :: copy = YES fi;
    if
    :: copy ->
        IF(29, good = true, pen_tuning_settle()); // if (pen_tuning_settle(tuning)) {
        d_step {
        pen_tuning_inactive();                    // const pen_set_t *const running = &tuning->slot[pen_tuning_inactive(tuning) ^ 1U];
        target = slot ^ 1
        }
    :: else -> good = true
    fi;
    if
    :: good -> pen_tuning_begin()                 // status = pen_tuning_begin(tuning, layout, length, &head);
    :: else
    fi;
    d_step {
        if
        :: good && copy ->                        // status = pen_tuning_write(tuning, length, 0U, running->value, length);
            assert(mine[ID(target)] == id_now);
            fill = 2
        :: else
        fi;
        copy = NO;
        target = 0
    }
}

inline note_fill()
{
    if :: offset + 1 > fill -> fill = offset + 1 :: else fi // tuning->fill = (end > tuning->fill) ? end : tuning->fill;
}

inline pen_tuning_write() /* one value, the right one or a wrong one; bytes are no different */
{
    pen_tuning_inactive();                        // pen_real_t *const bank = open_bank(tuning);
    if
    :: !open && MUTANT != 17                      // if (bank == NULL) {
    :: else ->
        atomic {
        if :: offset = 0 :: offset = 1 fi;
        if :: content = id :: content = BAD fi
        }
        TOGETHER {
        if
        :: offset > fill                          // } else if ((offset > length) || (n > (length - offset)) || ((SIZE * offset) > tuning->fill)) {
        :: else ->
            store(WORD(staging, offset), content); // bank[offset + i] = value[i];
            note_fill()                           // note_fill(tuning, SIZE * (offset + n));
        fi;
        d_step { offset = 0; content = 0 }
        }
    fi
}

inline pen_tuning_expect()
{
    skip /* begin has named the right one */      // tuning->slot[pen_tuning_inactive(tuning)].head.checksum = checksum;
}

inline pen_tuning_commit()
{
    pen_tuning_inactive();                        // const pen_set_t *const set = &tuning->slot[pen_tuning_inactive(tuning)];
    good = false;
    if
    :: !open && MUTANT != 18                      // if (open_bank(tuning) == NULL) {
    :: else ->
        if
        :: fill != 2 && MUTANT != 20              // } else if (tuning->fill != (SIZE * length)) {
        :: else -> IF(20, good = true,
                      pen_set_check(mine[ID(slot)], mine[VALUE(slot)])) // status = pen_set_check(set, layout, length);
        fi
    fi;
    if
    :: good ->
        d_step {
        ready_id = mine[ID(slot)];                // pen_set_copy(ready, set);
        ready_value = mine[VALUE(slot)];
        assert(!dropped) /* by abort, select or rollback */
        }
        pen_tuning_publish()
    :: else
    fi
}

inline pen_tuning_abort()
{
    d_step {
    IF(18, skip, open = NO);                      // tuning->open = NO;
    dropped = true
    }
}

inline pen_tuning_select()
{
    IF(6, good = true, pen_tuning_settle());      // } else if (!pen_tuning_settle(tuning)) {
    if
    :: good ->                                    // status = pen_set_check(set, layout, length);
        d_step {
        ready_value = FLASH;                      // pen_set_copy(ready, set);
        ready_id = ID_OF_FLASH
        }
        pen_tuning_publish()
    :: else
    fi
}

inline pen_tuning_rollback()
{
    IF(7, good = true, pen_tuning_settle());      // if (!pen_tuning_settle(tuning)) {
    if
    :: good && previous_value != NOWHERE ->       // } else if (tuning->previous.value == NULL) {
        assert(previous_id == id_before); /* what ran before what runs */
        pen_set_check(previous_id, previous_value); // status = pen_set_check(&tuning->previous, layout, length);
        d_step {
        assert(good);
        ready_id = previous_id;                   // pen_set_copy(ready, &tuning->previous);
        ready_value = previous_value
        }
        pen_tuning_publish()
    :: else
    fi
}

inline pen_tuning_hold()
{
    skip /* any value, at any time: see adopt */  // pen_port_store(&tuning->hold, hold ? PEN_HELD : PEN_OK);
}

inline pen_tuning_running()
{
    d_step {
        slot = mine[ID(seen[ACTIVE])];            // copy_head(head, &tuning->slot[pen_port_load(&tuning->active) & 1U].head);
        assert(slot == id_now || slot == id_before)
    }
}

init
{
    byte previous_id, previous_value, replaced_id, replaced_value; /* what the tuning context alone reads and writes */
    byte published, staging, fill;
    bool open;
    bool dropped; /* the set begun last must not come any more */
    byte id; /* of the set begun last */
    byte slot, target, ready_id, ready_value, offset, content;
    bool good, copy;
    atomic {
        id_now = ID_OF_FLASH;
        id_before = ID_OF_FLASH;
        for (b : 0 .. 1) {                        /* pen_tuning_init */
            mine[ID(b)] = ID_OF_FLASH;    memory[ID(b)] = ID_OF_FLASH;    seen[ID(b)] = ID_OF_FLASH;
            mine[VALUE(b)] = FLASH;    memory[VALUE(b)] = FLASH;    seen[VALUE(b)] = FLASH;
            mine[PIECES(b)] = ID_OF_FLASH; memory[PIECES(b)] = ID_OF_FLASH; seen[PIECES(b)] = ID_OF_FLASH;
        }
        previous_value = NOWHERE;
        replaced_value = NOWHERE;
        b = 0;
        run step()
    }
end:
    do
    :: d_step {
        slot = 0; good = false; ready_id = 0; ready_value = 0;
        if :: !open -> fill = 0; staging = 0; id = 0 :: else fi }
        if
#ifndef SELECT
        :: true -> pen_tuning_begin_copy()
        :: open || MUTANT == 17 || MUTANT == 18 -> pen_tuning_write() /* closed: nothing happens */
        :: open -> pen_tuning_expect()
        :: open || MUTANT == 18 -> pen_tuning_commit()
        :: open -> pen_tuning_abort()
#endif
        :: true -> pen_tuning_select()
        :: true -> pen_tuning_rollback()
        :: true -> pen_tuning_withdraw()
        :: true -> pen_tuning_hold()
        :: true -> pen_tuning_running()
        fi
    od
}

#include "spin_step.pml"
