/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * src/pen_set.c with its two contexts, for Spin. An inline has the name of the C function that it stands for, and each
 * of its lines ends in the C line that it is (spin.py compares the two, so that neither can change alone). What is
 * folded when a set is announced belongs to the generated code; here it is one word for each slot.
 *
 * Memory. WEAK: a store lies with its writer, then in memory, then is seen by the other context; it goes on at any time,
 * in any order, and only a barrier of the one who waits forces it. So stores come late and out of order, and loads see
 * old values. Without WEAK every store is seen at once: any interleaving of two contexts on one core, whichever
 * pre-empts the other. Words are whole (pen_port.h), everything larger is not. Not modelled: a load that takes its value
 * from a store that comes after it in the program.
 *
 * The tuning context makes any calls, without end, in any order, with good and bad values; the step runs forever. The
 * states are finite, so all of them are looked at: a set is known by an id, which comes back once nothing has it.
 * SELECT: only select and rollback. What is staged plays no part in whether a set is adopted, so `adopted`, which takes
 * many times more states, is shown with these.
 * A MUTANT is the protocol with one fault; spin.py lists them. Each must be caught by an assertion or by `adopted`.
 */

#ifndef MUTANT
#define MUTANT 0
#endif
#define IF(mutant, faulty, right) if :: MUTANT == mutant -> faulty :: else -> right fi

#define NO  0
#define YES 1

/* a set: what it is called, and where its values lie */
#define BANK0   0
#define BANK1   1
#define FLASH   2 /* a set of constants */
#define NOWHERE 3
#define ID_OF_FLASH 4 /* those staged are 1 to 3                      */
#define BAD         5 /* a value that belongs to no set that one has  */

/* words with one writer: the tuning context's */
#define VALUE(slot)   (slot)            /* slot[].value      */
#define ID(slot)      (2 + (slot))      /* slot[].head       */
#define WORD(bank, i) (4 + 2*(bank) + (i)) /* bank[][], two values each */
#define PIECES(slot)  (8 + (slot))      /* folded            */
/* the step's */
#define ACTIVE 10
#define WORDS  11

byte mine[WORDS];   /* as the writer sees it */
byte memory[WORDS];
byte seen[WORDS];   /* by the other one      */

/* pending has two writers: the tuning context stores YES, the step stores NO */
bool yes_on_its_way, no_on_its_way;
bool pending, pending_for_tuner, pending_for_step;

inline store(word, content)
{
    d_step {
        mine[word] = content;
#ifndef WEAK
        memory[word] = content;
        seen[word] = content;
#endif
    }
}

inline yes_arrives() { pending = YES; yes_on_its_way = false; pending_for_tuner = YES }
inline no_arrives()  { pending = NO;  no_on_its_way = false;  pending_for_step = NO }

inline store_pending_yes()
{
    d_step {
        yes_on_its_way = true;
#ifndef WEAK
        yes_arrives();
        pending_for_step = YES;
#endif
    }
}

inline store_pending_no()
{
    d_step {
        no_on_its_way = true;
#ifndef WEAK
        no_arrives();
        pending_for_tuner = NO;
#endif
    }
}

#define load_pending_tuner (yes_on_its_way || pending_for_tuner)
#define load_pending_step  (!no_on_its_way && pending_for_step)

byte b;
inline barrier_of_tuner()
{
    d_step {
        for (b : 0 .. ACTIVE - 1) { memory[b] = mine[b] }
        seen[ACTIVE] = memory[ACTIVE];
        if :: yes_on_its_way -> yes_arrives() :: else fi;
        pending_for_tuner = pending;
        b = 0
    }
}

inline barrier_of_step()
{
    d_step {
        memory[ACTIVE] = mine[ACTIVE];
        for (b : 0 .. ACTIVE - 1) { seen[b] = memory[b] }
        if :: no_on_its_way -> no_arrives() :: else fi;
        pending_for_step = pending;
        b = 0
    }
}

#define CARRY(w) \
    :: d_step { mine[w] != memory[w] -> memory[w] = mine[w] } \
    :: d_step { memory[w] != seen[w] -> seen[w] = memory[w] }

#ifdef WEAK
active proctype bus_of_words()
{
end:
    do
    CARRY(0) CARRY(1) CARRY(2) CARRY(3) CARRY(4) CARRY(5) CARRY(6) CARRY(7) CARRY(8) CARRY(9) CARRY(10)
    od
}

active proctype bus_of_pending()
{
end:
    do
    :: d_step { yes_on_its_way -> yes_arrives() }
    :: d_step { no_on_its_way -> no_arrives() }
    :: d_step { pending_for_tuner != pending -> pending_for_tuner = pending }
    :: d_step { pending_for_step != pending -> pending_for_step = pending }
    od
}
#endif

/* ---- what must hold: told by counting, not by the protocol ---- */

bool waiting;   /* a set is announced and not adopted */
byte id_waiting, id_now, id_before; /* before: of what ran before that */

/* a committed set is adopted */
ltl adopted { [] (waiting -> <> !waiting) }

/* ---- pen_set.c, tuning context ---- */

inline pen_tuning_spare()
{
    spare = seen[ACTIVE] ^ 1; // return (pen_port_load(&tuning->active) & 1U) ^ 1U;
}

inline settled()
{
    good = !load_pending_tuner;                   // const bool done = (pen_port_load(&tuning->pending) == NO);
    IF(4, skip, barrier_of_tuner())               // pen_port_barrier();
}

inline pen_tuning_announce()
{
    pen_tuning_spare();                           // const uint32_t spare = pen_tuning_spare(tuning);
    /* the generated code has folded for this slot already */
    IF(19, store(PIECES(spare ^ 1), ready_id), store(PIECES(spare), ready_id));
    IF(9, store_pending_yes(), skip);
    store(ID(spare), ready_id);                   // tuning->slot[spare] = *ready;
    store(VALUE(spare), ready_value);
    IF(12, previous_id = ready_id,
           previous_id = mine[ID(spare ^ 1)]);    // tuning->previous = tuning->slot[spare ^ 1U];
    IF(12, previous_value = ready_value, previous_value = mine[VALUE(spare ^ 1)]);
    open = NO;                                    // tuning->open = NO;
    dropped = true;
    IF(1, skip, barrier_of_tuner());              // pen_port_barrier();
    atomic {
        assert(!waiting); /* none is announced over one that waits */
        waiting = true;
        id_waiting = ready_id;
        IF(15, skip, IF(9, skip, store_pending_yes())); // pen_port_store(&tuning->pending, YES);
    }
}

inline check_set(id, value)
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
    IF(5, good = true, settled());                // } else if (!settled(tuning)) {
    if
    :: good ->
        pen_tuning_spare();                       // const uint32_t free_slot = pen_tuning_spare(tuning);
        d_step {
            staging = mine[VALUE(spare ^ 1)];     // const pen_real_t *const running = tuning->slot[free_slot ^ 1U].value;
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
                assert(mine[VALUE(spare ^ 1)] + previous_value == BANK0 + BANK1);
                previous_id = 0;
                previous_value = NOWHERE          // tuning->previous.value = NULL;
            :: else
            fi;
            mine[WORD(staging, 0)] = BAD; memory[WORD(staging, 0)] = BAD; seen[WORD(staging, 0)] = BAD;
            mine[WORD(staging, 1)] = BAD; memory[WORD(staging, 1)] = BAD; seen[WORD(staging, 1)] = BAD;
            id = 1; /* one that no set has; what is left in the bank has none any more */
            do
            :: id == mine[ID(spare ^ 1)] || id == previous_id -> id++
            :: else -> break
            od
        }
        store(ID(spare), id);                     // tuning->slot[free_slot].head = *head;
        store(VALUE(spare), staging);             // tuning->slot[free_slot].value = tuning->bank[bank];
        fill = 0;                                 // tuning->fill = 0U;
        dropped = false;
        open = YES                                // tuning->open = YES;
    :: else
    fi
}

inline pen_tuning_write() /* one value, the right one or a wrong one */
{
    pen_tuning_spare();                           // pen_real_t *const bank = open_bank(tuning);
    if
    :: !open && MUTANT != 17                      // if (bank == NULL) {
    :: else ->
        if :: offset = 0 :: offset = 1 fi;
        if :: content = id :: content = BAD fi;
        if
        :: offset > fill                          // } else if ((offset > tuning->fill) || (offset > length) || (n > (length - offset))) {
        :: else ->
            store(WORD(staging, offset), content); // bank[offset + i] = value[i];
            if                                    // tuning->fill = ((offset + n) > tuning->fill) ? (offset + n) : tuning->fill;
            :: offset + 1 > fill -> fill = offset + 1
            :: else
            fi
        fi;
        d_step { offset = 0; content = 0 }
    fi
}

inline pen_tuning_commit()
{
    pen_tuning_spare();                           // const pen_set_t *const set = &tuning->slot[pen_tuning_spare(tuning)];
    good = false;
    if
    :: !open && MUTANT != 18                      // if (open_bank(tuning) == NULL) {
    :: else ->
        if
        :: fill != 2 && MUTANT != 20              // } else if (tuning->fill != length) {
        :: else -> IF(20, good = true,
                      check_set(mine[ID(spare)], mine[VALUE(spare)])) // status = check_set(set, layout, length);
        fi
    fi;
    if
    :: good ->
        ready_id = mine[ID(spare)];               // *ready = *set;
        ready_value = mine[VALUE(spare)];
        assert(!dropped); /* by abort, select or rollback */
        pen_tuning_announce()
    :: else
    fi
}

inline pen_tuning_abort()
{
    IF(18, skip, open = NO);                      // tuning->open = NO;
    dropped = true
}

inline pen_tuning_select()
{
    IF(6, good = true, settled());                // } else if (!settled(tuning)) {
    if
    :: good ->                                    // status = check_set(set, layout, length);
        ready_value = FLASH;                      // *ready = *set;
        ready_id = ID_OF_FLASH;
        pen_tuning_announce()
    :: else
    fi
}

inline pen_tuning_rollback()
{
    IF(7, good = true, settled());                // if (!settled(tuning)) {
    if
    :: good && previous_value != NOWHERE ->       // } else if (tuning->previous.value == NULL) {
        assert(previous_id == id_before); /* what ran before what runs */
        check_set(previous_id, previous_value);   // status = check_set(&tuning->previous, layout, length);
        assert(good);
        ready_id = previous_id;                   // *ready = tuning->previous;
        ready_value = previous_value;
        pen_tuning_announce()
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
        spare = mine[ID(seen[ACTIVE])];           // return tuning->slot[pen_port_load(&tuning->active) & 1U].head;
        assert(spare == id_now || spare == id_before)
    }
}

init
{
    byte previous_id, previous_value, staging, fill; /* what the tuning context alone reads and writes */
    bool open;
    bool dropped; /* the set begun last must not come any more */
    byte id; /* of the set begun last */
    byte spare, ready_id, ready_value, offset, content;
    bool good;
    atomic {
        id_now = ID_OF_FLASH;
        id_before = ID_OF_FLASH;
        for (b : 0 .. 1) {                        /* pen_tuning_init */
            mine[ID(b)] = ID_OF_FLASH;    memory[ID(b)] = ID_OF_FLASH;    seen[ID(b)] = ID_OF_FLASH;
            mine[VALUE(b)] = FLASH;    memory[VALUE(b)] = FLASH;    seen[VALUE(b)] = FLASH;
            mine[PIECES(b)] = ID_OF_FLASH; memory[PIECES(b)] = ID_OF_FLASH; seen[PIECES(b)] = ID_OF_FLASH;
        }
        previous_value = NOWHERE;
        b = 0;
        run step()
    }
end:
    do
    :: d_step {
        spare = 0; good = false; ready_id = 0; ready_value = 0;
        if :: !open -> fill = 0; staging = 0; id = 0 :: else fi }
        if
#ifndef SELECT
        :: true -> pen_tuning_begin()
        :: open || MUTANT == 17 || MUTANT == 18 -> pen_tuning_write() /* closed: nothing happens */
        :: open || MUTANT == 18 -> pen_tuning_commit()
        :: open -> pen_tuning_abort()
#endif
        :: true -> pen_tuning_select()
        :: true -> pen_tuning_rollback()
        :: true -> pen_tuning_hold()
        :: true -> pen_tuning_running()
        fi
    od
}

/* ---- pen_set.c, step ---- */

inline pen_tuning_adopt()
{
    slot = mine[ACTIVE];                          // uint32_t active = pen_port_load(&tuning->active) & 1U;
    if :: held = NO :: held = YES fi;             // pen_status_t status = pen_port_load(&tuning->hold) & PEN_HELD;
    if
    :: load_pending_step &&                       // if (pen_port_load(&tuning->pending) == YES) {
       !(MUTANT == 14 && held) ->
        IF(2, skip, barrier_of_step());           // pen_port_barrier();
        IF(8, store_pending_no(), skip);
        atomic {
            slot = slot ^ 1;                      // active ^= 1U;
            IF(13, skip, store(ACTIVE, slot));    // pen_port_store(&tuning->active, active);
            assert(waiting); /* each is adopted once */
            waiting = false;
            id_before = id_now;
            id_now = id_waiting;
            waited = false
        }
        IF(3, skip, barrier_of_step());           // pen_port_barrier();
        IF(8, skip, store_pending_no())           // pen_port_store(&tuning->pending, NO);
    :: else
    fi
}

proctype step()
{
    byte slot, place;
    bool held, waited;
end:
    do
    :: waited = waiting;
        pen_tuning_adopt();
#ifndef WEAK
        assert(!waited); /* announced before this step: this step has adopted it */
#endif
        assert(seen[ID(slot)] == id_now);
        assert(seen[PIECES(slot)] == id_now);
        place = seen[VALUE(slot)];
        if
        :: place >= FLASH -> assert(id_now == ID_OF_FLASH)
        :: else ->
            assert(seen[WORD(place, 0)] == id_now);
            assert(seen[WORD(place, 1)] == id_now)
        fi;
        d_step { place = 0; slot = 0; held = false; waited = false }
    od
}
