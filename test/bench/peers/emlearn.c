/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* The network as emlearn generates it. */

#include "emlearn_networks.h"

#include "rk4.h"

float peer_spring(float deflection)
{
    return spring_regress1(&deflection, 1);
}

float peer_damper(float rate)
{
    return damper_regress1(&rate, 1);
}
