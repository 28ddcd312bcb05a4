# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Evidence for causes in a model that is slightly wrong everywhere. Nothing here depends on the kind of plant.

The model is its own observer (`observer`): about 16 times a period of the motion its states are moved towards the measurement, as a
steady Kalman filter with an unmodelled force at every body does (`gain`). Its prediction errors are the innovations. Laws,
parameters and start states are fitted to these (`fit`), proposed by a score test (`screening`), weighed by a Laplace approximation
of the marginal likelihood (`criterion`), and have to predict blocks of the training that they were not fitted to (`blocks`).
With unmodelled forces of size 0 the observer is the free run, and all of this is an output-error method.

Sources: Ljung, System Identification, 2nd ed., 1999, sections 7.4 (prediction error), 16.4 (criteria); Kass and Raftery, Bayes
factors, JASA 90, 1995 (Laplace); Rubin, The Bayesian bootstrap, Ann. Statist. 9, 1981.
"""
