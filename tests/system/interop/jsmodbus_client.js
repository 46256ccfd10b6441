"use strict";
// jsmodbus_client.js PORT: prints the values that jsmodbus reads, one line "NAME JSON" each.
const net = require("net");
const modbus = require("jsmodbus");
const converse = require("./conversation.js");

const socket = new net.Socket();
const library = new modbus.client.TCP(socket, 1, 2000);
const bits = async (answer, count) => (await answer).response.body.valuesAsArray.slice(0, count);
const registers = async (answer) => (await answer).response.body.valuesAsBuffer;

const client = {
    coils: (address, count) => bits(library.readCoils(address, count), count),
    inputs: (address, count) => bits(library.readDiscreteInputs(address, count), count),
    holding: (address, count) => registers(library.readHoldingRegisters(address, count)),
    input: (address, count) => registers(library.readInputRegisters(address, count)),
    writeCoil: (address, value) => library.writeSingleCoil(address, value),
    writeRegister: (address, value) => library.writeSingleRegister(address, value),
    writeCoils: (address, values) => library.writeMultipleCoils(address, values),
    writeRegisters: (address, values) => library.writeMultipleRegisters(address, values),
    exception: (error) => (error.response ? error.response.body.code : String(error.message || error)),
    identity: async () => {
        const answer = await library.readDeviceIdentification(1, 0);
        return answer.response.body.objects.slice(0, 2).map((object) => object.value.toString());
    },
};

socket.on("connect", () =>
    converse(client).then(
        () => socket.end(),
        (error) => {
            console.error(error);
            process.exit(1);
        },
    ),
);
socket.connect({ host: "127.0.0.1", port: Number(process.argv[2]) });
