@insert banner
#ifndef PIEZO_H
#define PIEZO_H

#include <stddef.h>
@if counts
#include <stdint.h>
@end

#ifdef __cplusplus
extern "C" {
#endif

@if float_answers
typedef float piezo_real;
@end
@if not float_answers
typedef double piezo_real;
@end

@insert identity

/* Input beyond these is refused: the answer is not a number (NaN) and the state stays as it was. So is input that is
   not finite, and a step that is not positive. */
#define PIEZO_LARGEST_INPUT 1.0e6
#define PIEZO_SHORTEST_STEP_S 1.0e-9
#define PIEZO_LONGEST_STEP_S 1.0e6

/* What became of a saved state that was to be restored. Whatever is not PIEZO_RESTORED leaves the state as it was. */
typedef enum piezo_restoring {
    PIEZO_RESTORED = 0,
    PIEZO_NOT_A_STATE, /* other bytes, or too few */
    PIEZO_OTHER_VERSION, /* saved in another layout */
    PIEZO_OTHER_MODEL, /* of another model, direction or precision */
    PIEZO_DAMAGED /* the check sum does not fit, or a value is not finite */
} piezo_restoring;
@insert effect_types
@if forward

/* Forward: voltage [V] in, displacement [um] out. All that is remembered between two steps; one for each actuator.
   Copying it copies the memory. */
typedef struct piezo_forward {
@insert forward_fields
} piezo_forward;

@if started
/* Make the state that in which the model starts: behind what went before its record. */
@end
@if not started
/* Make the state that of a relaxed actuator. */
@end
void piezo_forward_init(piezo_forward *state);

#ifndef PIEZO_FIXED_STEP_ONLY
/* Return the displacement [um] after a step of any length step_s [s] that ends at voltage_v [V]. Calls exp and pow of
   the mathematical library, unless the step is the sample time. */
piezo_real piezo_forward_step(piezo_forward *state, piezo_real voltage_v, piezo_real step_s);
#endif

/* The same for a step of PIEZO_SAMPLE_TIME_S, everything about it computed beforehand; no library is called. */
piezo_real piezo_forward_step_fixed(piezo_forward *state, piezo_real voltage_v);
@insert forward_covariates

/* Write the state as plain bytes, PIEZO_FORWARD_N_BYTES of them, the same on every machine. */
void piezo_forward_save(const piezo_forward *state, unsigned char *bytes);

/* Read a saved state of n_bytes bytes. */
piezo_restoring piezo_forward_restore(piezo_forward *state, const unsigned char *bytes, size_t n_bytes);
@end
@if inverse

/* Inverse: desired displacement [um] in, voltage [V] out. All that is remembered between two steps; one for each
   actuator. Copying it copies the memory. */
typedef struct piezo_inverse {
@insert inverse_fields
} piezo_inverse;

/* Make the state that of a relaxed actuator at zero volts. */
void piezo_inverse_init(piezo_inverse *state);

#ifndef PIEZO_FIXED_STEP_ONLY
/* Return the voltage [V] after a step of any length step_s [s] that ends at desired_um [um]. Calls exp and pow of the
   mathematical library, unless the step is the sample time. */
piezo_real piezo_inverse_step(piezo_inverse *state, piezo_real desired_um, piezo_real step_s);
#endif

/* The same for a step of PIEZO_SAMPLE_TIME_S, everything about it computed beforehand; no library is called. */
piezo_real piezo_inverse_step_fixed(piezo_inverse *state, piezo_real desired_um);
@insert inverse_covariates

/* What the voltage may do on its way out. */
typedef struct piezo_limits {
    piezo_real minimum_v; /* lowest voltage */
    piezo_real maximum_v; /* highest voltage */
    piezo_real slew_v_per_s; /* fastest change */
    piezo_real safe_v; /* where to ramp when told to stop */
    piezo_real safe_ramp_v_per_s; /* how fast */
} piezo_limits;

/* The limits given at export. */
extern const piezo_limits piezo_default_limits;

/* As the steps above, but the voltage stays within the limits, counted from the last one put out; the memory then
   follows the actuator to where the limited voltage takes it, not to where it was wanted. */
#ifndef PIEZO_FIXED_STEP_ONLY
piezo_real piezo_inverse_step_limited(
    piezo_inverse *state, const piezo_limits *limits, piezo_real desired_um, piezo_real step_s);
#endif
piezo_real piezo_inverse_step_fixed_limited(
    piezo_inverse *state, const piezo_limits *limits, piezo_real desired_um);

/* Return the next voltage [V] of the ramp to the safe voltage; the memory follows. */
#ifndef PIEZO_FIXED_STEP_ONLY
piezo_real piezo_inverse_ramp_to_safe(piezo_inverse *state, const piezo_limits *limits, piezo_real step_s);
#endif
piezo_real piezo_inverse_ramp_to_safe_fixed(piezo_inverse *state, const piezo_limits *limits);

/* Write the state as plain bytes, PIEZO_INVERSE_N_BYTES of them, the same on every machine. */
void piezo_inverse_save(const piezo_inverse *state, unsigned char *bytes);

/* Read a saved state of n_bytes bytes. */
piezo_restoring piezo_inverse_restore(piezo_inverse *state, const unsigned char *bytes, size_t n_bytes);
@end

#ifdef __cplusplus
}
#endif
#endif
