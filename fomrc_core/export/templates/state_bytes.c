
/* A saved state: "FOMRC", version, direction and size of a number, the model's check sum, how many bytes follow the
   header, their CRC-32; then the numbers in the order of the struct. All integers and numbers with the lowest byte
   first, numbers as IEEE 754 binary32 or binary64. */
enum { HEADER_BYTES = 24, VERSION_AT = 5, DIRECTION_AT = 6, SIZE_AT = 7, MODEL_AT = 8, LENGTH_AT = 16, CRC_AT = 20 };

static const unsigned char MODEL_BYTES[8] = PIEZO_MODEL_BYTES;

static void put_word(unsigned char *bytes, uint32_t word)
{
    for (int i = 0; i < 4; i++) bytes[i] = (unsigned char)((word >> (8 * i)) & 0xffu);
}

static uint32_t get_word(const unsigned char *bytes)
{
    uint32_t word = 0;
    for (int i = 3; i >= 0; i--) word = (word << 8) | bytes[i];
    return word;
}

/* The CRC-32 of IEEE 802.3, bit by bit: no table in memory, and a state is saved seldom. */
static uint32_t crc_of(const unsigned char *bytes, size_t n_bytes)
{
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < n_bytes; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) crc = (crc >> 1) ^ (0xedb88320u & (0u - (crc & 1u)));
    }
    return ~crc;
}

@if float
static unsigned char *put_reals(unsigned char *bytes, const float *values, size_t n_values)
{
    for (size_t i = 0; i < n_values; i++, bytes += 4) {
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        put_word(bytes, bits);
    }
    return bytes;
}

static const unsigned char *get_reals(const unsigned char *bytes, float *values, size_t n_values, int *are_finite)
{
    for (size_t i = 0; i < n_values; i++, bytes += 4) {
        const uint32_t bits = get_word(bytes);
        memcpy(&values[i], &bits, sizeof bits);
        *are_finite = *are_finite && is_within(values[i], FLT_MAX);
    }
    return bytes;
}
@end
@if doubles

static unsigned char *put_doubles(unsigned char *bytes, const double *values, size_t n_values)
{
    for (size_t i = 0; i < n_values; i++, bytes += 8) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        put_word(bytes, (uint32_t)(bits & 0xffffffffu));
        put_word(bytes + 4, (uint32_t)(bits >> 32));
    }
    return bytes;
}

static const unsigned char *get_doubles(const unsigned char *bytes, double *values, size_t n_values, int *are_finite)
{
    for (size_t i = 0; i < n_values; i++, bytes += 8) {
        const uint64_t bits = ((uint64_t)get_word(bytes + 4) << 32) | get_word(bytes);
        memcpy(&values[i], &bits, sizeof bits);
        *are_finite = *are_finite && values[i] >= -DBL_MAX && values[i] <= DBL_MAX;
    }
    return bytes;
}
@end
@if counts

static unsigned char *put_counts(unsigned char *bytes, const uint32_t *values, size_t n_values)
{
    for (size_t i = 0; i < n_values; i++, bytes += 4) put_word(bytes, values[i]);
    return bytes;
}

static const unsigned char *get_counts(const unsigned char *bytes, uint32_t *values, size_t n_values)
{
    for (size_t i = 0; i < n_values; i++, bytes += 4) values[i] = get_word(bytes);
    return bytes;
}
@end

static void put_header(unsigned char *bytes, unsigned char direction, size_t n_bytes)
{
    memcpy(bytes, "FOMRC", 5);
    bytes[VERSION_AT] = PIEZO_STATE_VERSION;
    bytes[DIRECTION_AT] = direction;
    bytes[SIZE_AT] = sizeof(real);
    memcpy(bytes + MODEL_AT, MODEL_BYTES, sizeof MODEL_BYTES);
    put_word(bytes + LENGTH_AT, (uint32_t)(n_bytes - HEADER_BYTES));
    put_word(bytes + CRC_AT, crc_of(bytes + HEADER_BYTES, n_bytes - HEADER_BYTES));
}

static piezo_restoring check_header(
    const unsigned char *bytes, size_t n_bytes, unsigned char direction, size_t n_expected)
{
    if (n_bytes < HEADER_BYTES || memcmp(bytes, "FOMRC", 5) != 0) return PIEZO_NOT_A_STATE;
    if (bytes[VERSION_AT] != PIEZO_STATE_VERSION) return PIEZO_OTHER_VERSION;
    if (bytes[DIRECTION_AT] != direction || bytes[SIZE_AT] != sizeof(real) ||
        memcmp(bytes + MODEL_AT, MODEL_BYTES, sizeof MODEL_BYTES) != 0)
        return PIEZO_OTHER_MODEL;
    if (n_bytes < n_expected || get_word(bytes + LENGTH_AT) != n_expected - HEADER_BYTES) return PIEZO_NOT_A_STATE;
    if (get_word(bytes + CRC_AT) != crc_of(bytes + HEADER_BYTES, n_expected - HEADER_BYTES)) return PIEZO_DAMAGED;
    return PIEZO_RESTORED;
}
@if forward

void piezo_forward_save(const piezo_forward *state, unsigned char *bytes)
{
    unsigned char *at = bytes + HEADER_BYTES;
@insert forward_put
    (void)at;
    put_header(bytes, 'F', PIEZO_FORWARD_N_BYTES);
}

piezo_restoring piezo_forward_restore(piezo_forward *state, const unsigned char *bytes, size_t n_bytes)
{
    const piezo_restoring answer = check_header(bytes, n_bytes, 'F', PIEZO_FORWARD_N_BYTES);
    const unsigned char *at = bytes + HEADER_BYTES;
    piezo_forward restored;
    int are_finite = 1;
    if (answer != PIEZO_RESTORED) return answer;
@insert forward_get
    (void)at;
    if (!are_finite) return PIEZO_DAMAGED;
    *state = restored;
    return PIEZO_RESTORED;
}
@end
@if inverse

void piezo_inverse_save(const piezo_inverse *state, unsigned char *bytes)
{
    unsigned char *at = bytes + HEADER_BYTES;
@insert inverse_put
    (void)at;
    put_header(bytes, 'I', PIEZO_INVERSE_N_BYTES);
}

piezo_restoring piezo_inverse_restore(piezo_inverse *state, const unsigned char *bytes, size_t n_bytes)
{
    const piezo_restoring answer = check_header(bytes, n_bytes, 'I', PIEZO_INVERSE_N_BYTES);
    const unsigned char *at = bytes + HEADER_BYTES;
    piezo_inverse restored;
    int are_finite = 1;
    if (answer != PIEZO_RESTORED) return answer;
@insert inverse_get
    (void)at;
    if (!are_finite) return PIEZO_DAMAGED;
    *state = restored;
    return PIEZO_RESTORED;
}
@end
