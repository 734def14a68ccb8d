// Every block of drivebench's register map through modbus-serial: node modbus_serial.mjs HOST PORT. Prints the
// values as JSON.
import ModbusRTU from "modbus-serial";

const [host, port] = process.argv.slice(2);
const client = new (ModbusRTU.default ?? ModbusRTU)();
await client.connectTCP(host, { port: Number(port) });
client.setID(1);
client.setTimeout(10000);

const read = async (address, count) => (await client.readHoldingRegisters(address, count)).data;
const refused = async (promise) => {
  try {
    await promise;
    return 0;
  } catch (error) {
    return error.modbusCode ?? String(error);
  }
};
const float = (words) => {
  const buffer = Buffer.alloc(4);
  words.forEach((word, i) => buffer.writeUInt16BE(word, 2 * i));
  return buffer.readFloatBE(0);
};
const words = (value) => {
  const buffer = Buffer.alloc(4);
  buffer.writeFloatBE(value);
  return [buffer.readUInt16BE(0), buffer.readUInt16BE(2)];
};

const found = {};
found.header = await read(0, 30);
found.input = (await client.readInputRegisters(0, 2)).data;
found.float = float(await read(18, 2));
found.mirror = float((await read(10018, 2)).reverse());
found.blocks = [];
for (let i = 6; i < 18; i += 3) {
  found.blocks.push((await read(found.header[i + 1], Math.min(found.header[i + 2], 125))).length);
}
found.identification = (await client.readDeviceIdentification(1, 0)).data;
found.withoutLease = await refused(client.writeRegisters(1002, words(2.0)));
found.gap = await refused(client.readHoldingRegisters(90, 1));
found.tooMany = await refused(client.readHoldingRegisters(200, 126));

await client.writeRegister(400, 4711);
found.coils = (await client.readCoils(0, 2)).data.slice(0, 2);
await client.writeRegisters(1002, words(2.5));
found.parameter = float(await read(1002, 2));
for (const word of [0x06, 0x07, 0x0f]) await client.writeRegisters(101, [word, 1000, 500]);
found.status = (await read(104, 1))[0];
found.voltage = float(await read(260, 2));
await client.maskWriteRegister(101, 0xfff7, 0);
found.disabled = (await read(104, 1))[0];
const tick = (await read(200, 4))[3];
const exchanged = await client.readWriteRegisters(200, 86, 402, 7, [1, 0, tick, ...words(12.0), ...words(-3.0)]);
found.exchanged = [exchanged.data[3] - tick, float(exchanged.data.slice(60, 62)), float(exchanged.data.slice(62, 64))];
found.discrete = (await client.readDiscreteInputs(16, 5)).data.slice(0, 5);
await client.writeCoil(1, true);
await client.writeCoils(0, [false, false]);
found.released = (await read(409, 1))[0];
client.close(() => console.log(JSON.stringify(found)));
