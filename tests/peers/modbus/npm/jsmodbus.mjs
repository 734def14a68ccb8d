// Every block of drivebench's register map through jsmodbus: node jsmodbus.mjs HOST PORT. Prints the values as JSON.
import net from "node:net";
import jsmodbus from "jsmodbus";

const [host, port] = process.argv.slice(2);
const socket = new net.Socket();
const client = new jsmodbus.client.TCP(socket, 1, 10000);
socket.connect({ host, port: Number(port) });
await new Promise((resolve, reject) => socket.once("connect", resolve).once("error", reject));

const buffer = async (address, count) => (await client.readHoldingRegisters(address, count)).response.body.valuesAsBuffer;
const words = async (address, count) => {
  const bytes = await buffer(address, count);
  return Array.from({ length: count }, (_, i) => bytes.readUInt16BE(2 * i));
};
const refused = async (promise) => {
  try {
    await promise;
    return 0;
  } catch (error) {
    return error.response?.body?.code ?? String(error.message);
  }
};
const floats = (...values) => {
  const bytes = Buffer.alloc(4 * values.length);
  values.forEach((value, i) => bytes.writeFloatBE(value, 4 * i));
  return bytes;
};

const found = {};
found.header = await words(0, 30);
found.input = (await client.readInputRegisters(0, 2)).response.body.valuesAsArray.slice(0, 2);
found.float = (await buffer(18, 2)).readFloatBE(0);
found.mirror = (await buffer(10018, 2)).swap16().swap32().readFloatBE(0);
found.integer = (await buffer(20, 2)).readInt32BE(0);
found.blocks = [];
for (let i = 6; i < 18; i += 3) {
  found.blocks.push((await words(found.header[i + 1], Math.min(found.header[i + 2], 125))).length);
}
found.withoutLease = await refused(client.writeMultipleRegisters(1002, floats(2.0)));
found.gap = await refused(client.readHoldingRegisters(90, 1));

await client.writeSingleRegister(400, 4712);
found.coils = (await client.readCoils(0, 2)).response.body.valuesAsArray.slice(0, 2);
await client.writeMultipleRegisters(1002, floats(2.5));
found.parameter = (await buffer(1002, 2)).readFloatBE(0);
for (const word of [0x06, 0x07, 0x0f]) await client.writeMultipleRegisters(101, [word, 1000, 500]);
found.status = (await words(104, 1))[0];
found.voltage = (await buffer(260, 2)).readFloatBE(0);
const tick = (await words(200, 4))[3];
await client.writeMultipleRegisters(402, Buffer.concat([Buffer.from([0, 1, 0, 0, tick >> 8, tick & 255]), floats(12.0, -3.0)]));
found.command = [(await words(200, 4))[3] - tick, (await buffer(260, 2)).readFloatBE(0), (await buffer(262, 2)).readFloatBE(0)];
found.discrete = (await client.readDiscreteInputs(16, 5)).response.body.valuesAsArray.slice(0, 5);
await client.writeSingleCoil(1, true);
await client.writeMultipleCoils(0, [false, false]);
found.released = (await words(409, 1))[0];
socket.end();
console.log(JSON.stringify(found));
