/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * src/pen_set.c with its two contexts, for Spin. An inline has the name of the C function that it stands for, and each
 * of its lines ends in the C line that it is (spin_check.py compares the two, so that neither can change alone). What is
 * folded when a set is published belongs to the generated code; here it is one word for each slot.
 *
 * Memory. WEAK: a store lies with its writer, then in memory, then is seen by the other context; it goes on at any time,
 * in any order, and only a barrier of the one who waits forces it. So stores come late and out of order, and loads see
 * old values. `active` and `pending`, which decide what is done next, are carried by a process; what the step only reads
 * is not: it is looked at in all three places, any of which the step may see. Without WEAK every store is seen at once: any interleaving of two contexts on one core, whichever
 * pre-empts the other. Words are whole (pen_port.h), everything larger is not. Not modelled: a load that takes its value
 * from a store that comes after it in the program.
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

/* words of pending */
#define NOTHING  0
#define ADOPT    1 /* + slot */
#define WITHDRAW 3 /* + slot */
#define CLEARED  5 /* NOTHING, stored by the tuning context: a fault */

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

/* pending has two writers: the tuning context stores a word, the step stores NOTHING */
byte word_on_its_way; /* 0: none */
bool nothing_on_its_way;
byte pending, pending_for_tuner, pending_for_step;

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

inline word_arrives()    { pending = word_on_its_way % CLEARED; word_on_its_way = 0; pending_for_tuner = pending }
inline nothing_arrives() { pending = NOTHING; nothing_on_its_way = false; pending_for_step = NOTHING }

inline store_pending_of_tuner(command)
{
    d_step {
        word_on_its_way = command; /* over one that is still on its way, too */
#ifndef WEAK
        word_arrives();
        pending_for_step = pending;
#endif
    }
}

inline store_pending_of_step()
{
    d_step {
        nothing_on_its_way = true;
#ifndef WEAK
        nothing_arrives();
        pending_for_tuner = NOTHING;
#endif
    }
}

#define load_pending_tuner (word_on_its_way != 0 -> word_on_its_way % CLEARED : pending_for_tuner)
#define load_pending_step  (nothing_on_its_way -> NOTHING : pending_for_step)

byte b;
inline barrier_of_tuner()
{
    d_step {
        for (b : 0 .. ACTIVE - 1) { memory[b] = mine[b] }
        seen[ACTIVE] = memory[ACTIVE];
        if :: word_on_its_way != 0 -> word_arrives() :: else fi;
        pending_for_tuner = pending;
        b = 0
    }
}

inline barrier_of_step()
{
    d_step {
        memory[ACTIVE] = mine[ACTIVE];
        for (b : 0 .. ACTIVE - 1) { seen[b] = memory[b] }
        if :: nothing_on_its_way -> nothing_arrives() :: else fi;
        pending_for_step = pending;
        b = 0
    }
}

#ifdef WEAK
active proctype bus_of_active()
{
end:
    do
    :: d_step { mine[ACTIVE] != memory[ACTIVE] -> memory[ACTIVE] = mine[ACTIVE] }
    :: d_step { memory[ACTIVE] != seen[ACTIVE] -> seen[ACTIVE] = memory[ACTIVE] }
    od
}

active proctype bus_of_pending()
{
end:
    do
    :: d_step { word_on_its_way != 0 -> word_arrives() }
    :: d_step { nothing_on_its_way -> nothing_arrives() }
    :: d_step { pending_for_tuner != pending -> pending_for_tuner = pending }
    :: d_step { pending_for_step != pending -> pending_for_step = pending }
    od
}
#endif

/* ---- what must hold: told by counting, not by the protocol ---- */

bool waiting;  /* a set is published, and neither adopted nor withdrawn        */
bool asked;    /* its withdrawal has been asked for                            */
bool granted;  /* the step has reported that it is withdrawn                   */
bool way_back; /* there was a rollback set before it was published             */
byte id_waiting, id_now, id_before; /* before: of what ran before that */

/* a committed set is adopted or, if that was asked for, withdrawn; then another may be published */
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
            :: slot != published - 1 ->           // if (active != ((tuning->published - 1U) & 1U)) {
                assert(granted);
                if :: MUTANT != 27 -> previous_id = replaced_id :: else fi; // pen_set_copy(&tuning->previous, &tuning->replaced);
                if :: MUTANT != 27 -> previous_value = replaced_value :: else fi;
                assert(!way_back || (previous_value != NOWHERE && previous_id == id_before))
            :: else ->
                assert(!granted && mine[ID(slot)] == id_now) /* it is in force, also if its withdrawal was overtaken */
            fi;
            skip;                                 // tuning->settled = active;
            published = 0;                        // tuning->published = 0U;
            replaced_id = 0;
            replaced_value = NOWHERE;
            asked = false;
            granted = false;
            way_back = false
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
    way_back = (previous_value != NOWHERE);
    IF(12, previous_id = ready_id,
           previous_id = mine[ID(slot ^ 1)]);     // pen_set_copy(&tuning->previous, &tuning->slot[slot ^ 1U]);
    IF(12, previous_value = ready_value, previous_value = mine[VALUE(slot ^ 1)]);
    open = NO;                                    // tuning->open = NO;
    dropped = true;
    published = 1 + slot                          // tuning->published = 1U + slot;
    }
    }
    IF(1, skip, barrier_of_tuner());              // pen_port_barrier();
    atomic {
        assert(!waiting); /* none is published over one that waits */
        waiting = true;
        id_waiting = ready_id;
        IF(15, skip, IF(9, skip, store_pending_of_tuner(ADOPT + slot))); // pen_port_store(&tuning->pending, ADOPT + slot);
    }
}

inline pen_tuning_withdraw()
{
    d_step { target = published; }                // const uint32_t slot = (tuning->published - 1U) & 1U;
    IF(24, good = false, pen_tuning_settle());    // if (pen_tuning_settle(tuning)) {
    if
    :: good
    :: !good && (load_pending_tuner == ADOPT + target - 1 || /* asked for once only */
                 MUTANT == 24 || MUTANT == 26) -> // } else if (pen_port_load(&tuning->pending) == (ADOPT + slot)) {
        atomic { /* the step may have adopted it since */
            asked = true;
            IF(21, store_pending_of_tuner(CLEARED),
                   store_pending_of_tuner(WITHDRAW + (target + 1) % 2)) // pen_port_store(&tuning->pending, WITHDRAW + slot);
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

/* A copy of what runs. Its values are not those of the set that is to be made of it: what counts is where they come from. */
inline pen_tuning_begin_copy()
{
    if :: copy = NO :: copy = YES fi;
    if
    :: copy ->
        IF(29, good = true, pen_tuning_settle()); // const bool settled = pen_tuning_settle(tuning);
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
        :: offset > fill                          // status = check_chunk(tuning, SIZE * length, SIZE * offset, SIZE * n);
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

/* ---- pen_set.c, step ---- */

inline pen_tuning_adopt()
{
    atomic {
    running = mine[ACTIVE];                        // uint32_t active = pen_port_load(&tuning->active) & 1U;
    if :: held = NO :: held = YES fi;             // pen_status_t status = pen_port_load(&tuning->hold) & PEN_HELD;
    word = load_pending_step                      // const uint32_t pending = pen_port_load(&tuning->pending);
    }
    if
    :: word != NOTHING &&                         // if (pending != 0U) {
       !(MUTANT == 14 && held) ->
        skip;                                     // const uint32_t other = active ^ 1U;
        IF(2, skip, barrier_of_step());           // pen_port_barrier();
        IF(8, store_pending_of_step(), skip);
        atomic {
            if
            :: word == ADOPT + (running ^ 1) || MUTANT == 22 -> // if (pending == (ADOPT + other)) {
                running = running ^ 1;              // active = other;
                IF(13, skip, store(ACTIVE, running)); // pen_port_store(&tuning->active, active);
                assert(waiting); /* each is adopted once, and none that is withdrawn */
                waiting = false;                  // status |= PEN_ADOPTED;
                id_before = id_now;
                id_now = id_waiting;
                id_waiting = 0;
                waited = false
            :: else ->
                if
                :: word == WITHDRAW + (running ^ 1) || // } else if (pending == (WITHDRAW + other)) {
                   (MUTANT == 23 && word >= WITHDRAW) ->
                    assert(waiting && asked); /* reported once, and only if asked for */
                    waiting = false;              // status |= PEN_WITHDRAWN;
                    granted = true;
                    id_waiting = 0;
                    waited = false
                :: else                           // } else {
                fi
            fi
        }
        IF(3, skip, barrier_of_step());           // pen_port_barrier();
        if
        :: MUTANT == 8
        :: MUTANT == 28 && word == WITHDRAW + running
        :: else -> store_pending_of_step()        // pen_port_store(&tuning->pending, 0U);
        fi
    :: else
    fi
}

/* The step may see what has been carried to it, what lies in memory, or what is on its way: all must be the same. */
inline look(word, content)
{
    assert(seen[word] == content && memory[word] == content && mine[word] == content)
}

proctype step()
{
    byte running, place, word;
    bool held, waited;
end:
    do
    :: waited = waiting;
        pen_tuning_adopt();
        d_step { /* one look, at any time until the next step */
#ifndef WEAK
        assert(!waited); /* published before this step: this step has adopted it, or withdrawn as asked */
#endif
        look(ID(running), id_now);
        look(PIECES(running), id_now);
        place = seen[VALUE(running)];
        look(VALUE(running), place);
        if
        :: place >= FLASH -> assert(id_now == ID_OF_FLASH)
        :: else ->
            look(WORD(place, 0), id_now);
            look(WORD(place, 1), id_now)
        fi;
        place = 0; running = 0; held = false; word = 0; waited = false }
    od
}
