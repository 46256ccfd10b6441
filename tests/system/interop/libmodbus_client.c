/* libmodbus_client PORT: prints the values that libmodbus reads as a client, one line "NAME JSON" each. */
#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static modbus_t* server;

static void must(int done, const char* what) {
    if (done >= 0) return;
    fprintf(stderr, "%s: %s\n", what, modbus_strerror(errno));
    exit(1);
}

static void print_words(const char* name, const uint16_t* words, int count) {
    printf("%s [", name);
    for (int i = 0; i < count; ++i) printf("%s%u", i ? "," : "", words[i]);
    printf("]\n");
}

static void print_bits(const char* name, const uint8_t* bits, int count) {
    printf("%s [", name);
    for (int i = 0; i < count; ++i) printf("%s%u", i ? "," : "", bits[i]);
    printf("]\n");
}

static uint16_t word_at(int address) {
    uint16_t word;
    must(modbus_read_registers(server, address, 1, &word), "FC 3 of one register");
    return word;
}

static int exception_of(int done) { return done >= 0 ? 0 : errno - MODBUS_ENOBASE; }

static void pause_ms(long ms) {
    const struct timespec time = {0, ms * 1000000};
    nanosleep(&time, NULL);
}

static void reads(void) {
    uint16_t words[12];
    uint8_t bits[34];
    must(modbus_read_registers(server, 0, 2, words), "magic");
    print_words("magic", words, 2);
    printf("map_version %u\n", word_at(2));
    must(modbus_read_input_registers(server, 9000, 12, words), "FC 4 of the constants");
    print_words("constants_fc4", words, 12);
    must(modbus_read_registers(server, 9000, 12, words), "FC 3 of the constants");
    print_words("constants", words, 12);
    printf("int16 %d\nint32 %d\n", (int16_t)words[1], MODBUS_GET_INT32_FROM_INT16(words, 2));
    printf("float_abcd %g\nfloat_cdab %g\n", modbus_get_float_abcd(words + 4), modbus_get_float_cdab(words + 6));
    printf("text \"");
    for (int i = 8; i < 12; ++i) printf("%c%c", words[i] >> 8, words[i] & 0xFF);
    printf("\"\n");
    must(modbus_read_input_registers(server, 104, 3, words), "forces");
    printf("force_cN [%d,%d,%d]\n", (int16_t)words[0], (int16_t)words[1], (int16_t)words[2]);
    must(modbus_read_input_registers(server, 2102, 6, words), "floats");
    printf("force_N [%g,%g,%g]\n", modbus_get_float_abcd(words), modbus_get_float_abcd(words + 2),
           modbus_get_float_abcd(words + 4));
    must(modbus_read_input_registers(server, 3102, 6, words), "floats, low word first");
    printf("force_N_low_word_first [%g,%g,%g]\n", modbus_get_float_cdab(words), modbus_get_float_cdab(words + 2),
           modbus_get_float_cdab(words + 4));
    must(modbus_read_input_bits(server, 32, 2, bits), "FC 2");
    print_bits("inputs_ok", bits, 2);
    must(modbus_read_bits(server, 0, 34, bits), "FC 1");
    print_bits("coils", bits, 34);
}

static void scratch(void) {
    const uint16_t three[] = {1, 0xFFFF, 3}, others[] = {4, 5, 6};
    uint16_t words[3];
    must(modbus_write_register(server, 5100, 0xA55A), "FC 6");
    printf("scratch_fc6 %u\n", word_at(5100));
    must(modbus_write_registers(server, 5101, 3, three), "FC 16");
    must(modbus_read_registers(server, 5101, 3, words), "FC 3");
    print_words("scratch_fc16", words, 3);
    must(modbus_write_register(server, 5104, 0x0012), "FC 6");
    must(modbus_mask_write_register(server, 5104, 0x00F2, 0x0025), "FC 22");
    printf("scratch_fc22 %u\n", word_at(5104));
    must(modbus_write_and_read_registers(server, 5105, 3, others, 5105, 3, words), "FC 23");
    print_words("scratch_fc23", words, 3);
}

static void print_command(const char* name, uint16_t sequence, int ack_difference, uint16_t before) {
    uint16_t words[3];
    for (int i = 0; i < 600; ++i, pause_ms(5)) {
        must(modbus_read_registers(server, 25, 3, words), "CMD_SEQ_ACK");
        if (words[0] == sequence && words[1] != 1) break;
    }
    printf("%s [%d,%u,%u,%d]\n", name, ack_difference + words[0] - sequence, words[1], words[2], word_at(120) - before);
}

static void print_counted(const char* name, uint16_t before) {
    uint16_t now = word_at(120);
    for (int i = 0; i < 600 && now == before; ++i, pause_ms(5)) now = word_at(120);
    printf("%s %d\n", name, now - before);
    for (int i = 0; i < 600 && (word_at(7) & 0x100); ++i) pause_ms(5);
}

static void tares(void) {
    uint16_t before = word_at(120), sequence = (uint16_t)(word_at(25) + 1), answer[3];
    uint16_t block[] = {1, 1, 0, 0, sequence};
    must(modbus_write_registers(server, 5000, 5, block), "tare by the command block");
    print_command("tare_block", sequence, 0, before);

    before = word_at(120);
    block[4] = ++sequence;
    must(modbus_write_and_read_registers(server, 5000, 5, block, 25, 3, answer), "tare by FC 23");
    print_command("tare_fc23", sequence, answer[0] - sequence, before);

    before = word_at(120);
    must(modbus_write_register(server, 5010, 1), "tare by FC 6");
    print_counted("tare_register", before);

    before = word_at(120);
    must(modbus_write_bit(server, 0, 1), "tare by coil");
    uint8_t running = 1;
    for (int i = 0; i < 600 && running; ++i, pause_ms(5)) must(modbus_read_bits(server, 0, 1, &running), "coil 0");
    print_counted("tare_coil", before);
}

static void refusals(void) {
    const uint16_t two[] = {1, 2};
    const uint8_t clear[] = {1, 0}, none[] = {0, 0};
    uint16_t word;
    uint8_t id[256];
    must(modbus_write_bits(server, 16, 2, clear), "FC 15");
    const int fc6 = exception_of(modbus_write_register(server, 0, 1));
    const int fc16 = exception_of(modbus_write_registers(server, 9000, 2, two));
    const int fc5 = exception_of(modbus_write_bit(server, 34, 1));
    const int fc15 = exception_of(modbus_write_bits(server, 33, 2, none));
    printf("refused [%d,%d,%d,%d]\n", fc6, fc16, fc5, fc15);
    printf("refused_fc22 %d\n", exception_of(modbus_mask_write_register(server, 0, 0, 1)));
    printf("refused_fc23 %d\n", exception_of(modbus_write_and_read_registers(server, 0, 1, two, 0, 1, &word)));
    printf("fc17 %d\n", exception_of(modbus_report_slave_id(server, sizeof id, id)));
}

int main(int argc, char** argv) {
    if (argc != 2) return 2;
    server = modbus_new_tcp("127.0.0.1", atoi(argv[1]));
    if (server == NULL) return 1;
    modbus_set_slave(server, 1);
    must(modbus_connect(server), "connect");
    reads();
    scratch();
    tares();
    refusals();
    modbus_close(server);
    modbus_free(server);
    return 0;
}
