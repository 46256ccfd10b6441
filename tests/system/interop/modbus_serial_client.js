"use strict";
// modbus_serial_client.js PORT: prints the values that modbus-serial reads, one line "NAME JSON" each.
const ModbusRTU = require("modbus-serial");
const converse = require("./conversation.js");

const library = new ModbusRTU();
const bits = async (answer, count) => (await answer).data.slice(0, count);
const registers = async (answer) => (await answer).buffer;

const client = {
    coils: (address, count) => bits(library.readCoils(address, count), count),
    inputs: (address, count) => bits(library.readDiscreteInputs(address, count), count),
    holding: (address, count) => registers(library.readHoldingRegisters(address, count)),
    input: (address, count) => registers(library.readInputRegisters(address, count)),
    writeCoil: (address, value) => library.writeCoil(address, value),
    writeRegister: (address, value) => library.writeRegister(address, value),
    writeCoils: (address, values) => library.writeCoils(address, values),
    writeRegisters: (address, values) => library.writeRegisters(address, values),
    mask: (address, and, or) => library.maskWriteRegister(address, and, or),
    writeAndRead: async (address, values, from, count) => {
        const answer = await library.readWriteRegisters(from, count, address, values.length, values);
        const buffer = Buffer.alloc(2 * count);
        answer.data.forEach((word, i) => buffer.writeUInt16BE(word, 2 * i));
        return buffer;
    },
    // Version 8.0.25 settles its promise only if two arguments fill the places before the callback.
    serverId: () => library.reportServerID(0, 0),
    exception: (error) => error.modbusCode || String(error.message || error),
    identity: async () => {
        const objects = (await library.readDeviceIdentification(1, 0)).data;
        return [objects[0], objects[1]];
    },
};

async function main() {
    await library.connectTCP("127.0.0.1", { port: Number(process.argv[2]) });
    library.setID(1);
    library.setTimeout(2000);
    await converse(client);
    library.close(() => {});
}

main().catch((error) => {
    console.error(error);
    process.exit(1);
});
