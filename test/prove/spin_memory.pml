/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The words that the two contexts of spin_swap.pml share, and how a store comes from one to the other. */

/* words of pending: command(ADOPT, slot), command(WITHDRAW, slot) */
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
