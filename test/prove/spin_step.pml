/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* src/pen_set.c of the step, for spin_swap.pml. */

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
            :: word == ADOPT + (running ^ 1) || MUTANT == 22 -> // if (pending == command(ADOPT, other)) {
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
                :: word == WITHDRAW + (running ^ 1) || // } else if (pending == command(WITHDRAW, other)) {
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
