#!/bin/sh
# Make the committed set again: 13 short cases on the three robots here.  Needs requirements.txt.
cd "$(dirname "$0")" || exit 1
rm -rf set
exec "${PYTHON:-python3}" make.py --out set --seed 11 --prefix m --recordings 3,1 --seconds 5.8,6.4 --rates 50,100 --snr 12,40 --plan "\
stribeck_friction;viscous_friction;payload;counterbalance_spring;torque_ripple;torque_delay;torque_gain;external_push;\
coulomb_friction+payload;viscous_friction+torque_lowpass+cable_spring;asymmetric_coulomb+rotor_inertia+base_tilt+torque_gain;\
null;unknown:worn_segment"
