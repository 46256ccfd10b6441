"use strict";
// The requests of both JavaScript clients. `client` wraps a library: its reads of registers return a Buffer, and
// `exception` converts an error of the library to the exception code of the server.

const print = (name, value) => console.log(name, JSON.stringify(value));
const pause = () => new Promise((resolve) => setTimeout(resolve, 5));
const words = (buffer) => Array.from({ length: buffer.length / 2 }, (_, i) => buffer.readUInt16BE(2 * i));
const lowWordFirst = (buffer, at) =>
    Buffer.concat([buffer.subarray(at + 2, at + 4), buffer.subarray(at, at + 2)]).readFloatBE(0);

async function until(seconds, read, good) {
    const end = Date.now() + 1000 * seconds;
    let seen = await read();
    while (!good(seen) && Date.now() < end) {
        await pause();
        seen = await read();
    }
    return seen;
}

async function refusal(client, promise) {
    try {
        await promise;
        return 0;
    } catch (error) {
        return client.exception(error);
    }
}

async function reads(client) {
    print("magic", words(await client.holding(0, 2)));
    print("map_version", words(await client.holding(2, 1))[0]);
    const constants = await client.holding(9000, 12);
    print("constants", words(constants));
    print("constants_fc4", words(await client.input(9000, 12)));
    print("int16", constants.readInt16BE(2));
    print("int32", constants.readInt32BE(4));
    print("float_abcd", constants.readFloatBE(8));
    print("float_cdab", lowWordFirst(constants, 12));
    print("text", constants.toString("latin1", 16, 24));
    const force = await client.input(104, 3);
    print("force_cN", [0, 2, 4].map((at) => force.readInt16BE(at)));
    const high = await client.input(2102, 6);
    print("force_N", [0, 4, 8].map((at) => high.readFloatBE(at)));
    const low = await client.input(3102, 6);
    print("force_N_low_word_first", [0, 4, 8].map((at) => lowWordFirst(low, at)));
    print("inputs_ok", (await client.inputs(32, 2)).map(Number));
    print("coils", (await client.coils(0, 34)).map(Number));
}

async function scratch(client) {
    await client.writeRegister(5100, 0xa55a);
    print("scratch_fc6", words(await client.holding(5100, 1))[0]);
    await client.writeRegisters(5101, [1, 0xffff, 3]);
    print("scratch_fc16", words(await client.holding(5101, 3)));
    if (client.mask) {
        await client.writeRegister(5104, 0x0012);
        await client.mask(5104, 0x00f2, 0x0025);
        print("scratch_fc22", words(await client.holding(5104, 1))[0]);
    }
    if (client.writeAndRead) {
        print("scratch_fc23", words(await client.writeAndRead(5105, [4, 5, 6], 5105, 3)));
    }
}

async function tares(client) {
    const count = async () => words(await client.holding(120, 1))[0];
    const command = async () => words(await client.holding(25, 3));
    const finished = async (sequence, before) => {
        const seen = await until(3, command, ([ack, state]) => ack === sequence && state !== 1);
        return [seen[0] - sequence, seen[1], seen[2], (await count()) - before];
    };
    const counted = async (before) => (await until(3, count, (now) => now !== before)) - before;
    const idle = () => until(3, () => client.holding(7, 1), (status) => (words(status)[0] & 0x100) === 0);

    let before = await count();
    let sequence = (await command())[0] + 1;
    await client.writeRegisters(5000, [1, 1, 0, 0, sequence]);
    print("tare_block", await finished(sequence, before));

    if (client.writeAndRead) {
        before = await count();
        sequence += 1;
        const [ack] = words(await client.writeAndRead(5000, [1, 1, 0, 0, sequence], 25, 3));
        const [later, ...others] = await finished(sequence, before);
        print("tare_fc23", [ack - sequence + later, ...others]);
    }

    before = await count();
    await client.writeRegister(5010, 1);
    print("tare_register", await counted(before));
    await idle();

    before = await count();
    await client.writeCoil(0, true);
    await until(3, () => client.coils(0, 1), ([running]) => !running);
    print("tare_coil", await counted(before));
    await idle();
}

async function refusals(client) {
    print("refused", [
        await refusal(client, client.writeRegister(0, 1)),
        await refusal(client, client.writeRegisters(9000, [1, 2])),
        await refusal(client, client.writeCoil(34, true)),
        await refusal(client, client.writeCoils(33, [false, false])),
    ]);
    if (client.mask) print("refused_fc22", await refusal(client, client.mask(0, 0, 1)));
    if (client.writeAndRead) print("refused_fc23", await refusal(client, client.writeAndRead(0, [1], 0, 1)));
    if (client.serverId) print("fc17", await refusal(client, client.serverId()));
}

module.exports = async function converse(client) {
    await reads(client);
    await scratch(client);
    await tares(client);
    await client.writeCoils(16, [true, false]);
    await refusals(client);
    print("identity", await client.identity());
};
