// A torque drive on npm's `canopen`, alone on a bus that is served over TCP as text (socketcand).
// usage: node foreign_drive.js NODE; prints its port. Ends when its standard input does.
'use strict';

const Module = require('module');
const net = require('net');

// Compiled code for block transfers, which nobody asks for here: no compiler is needed.
const load = Module._load;
Module._load = (name, ...rest) => (name === 'node-crc' ? { crc: () => 0 } : load(name, ...rest));
const { Device, DataType, ObjectType } = require('canopen');

const NODE = Number(process.argv[2]);
const QUIET = 30; // ms: python-can reads the last `ok` alone
const clients = new Set();

function send(id, data, except) {
    const text = `< frame ${id.toString(16).padStart(3, '0')} 0.0 ${data.toString('hex')} >`;
    for (const client of clients) {
        if (client !== except) client.write(text);
    }
}

const device = new Device({ id: NODE });
const eds = device.eds;

function add(index, dataType, value, accessType = 'rw') {
    const name = `x${index.toString(16)}`;
    if (eds.getEntry(index)) eds.removeEntry(index);
    const entry = eds.addEntry(index, { parameterName: name, dataType, accessType });
    entry.value = value;
    return entry;
}

add(0x1000, DataType.UNSIGNED32, 0x00020192, 'ro');
add(0x1017, DataType.UNSIGNED16, 50); // the library's own call makes it 32 bits wide
add(0x1008, DataType.VISIBLE_STRING, 'npm drive', 'ro');
add(0x6007, DataType.INTEGER16, 0);
const control = add(0x6040, DataType.UNSIGNED16, 0);
const status = add(0x6041, DataType.UNSIGNED16, 0x0250, 'ro');
const mode = add(0x6060, DataType.INTEGER8, 0);
const shown = add(0x6061, DataType.INTEGER8, 0, 'ro');
const error = add(0x603f, DataType.UNSIGNED16, 0, 'ro');
const position = add(0x6064, DataType.INTEGER32, -1000, 'ro');
const target = add(0x6071, DataType.INTEGER16, 0);
add(0x6075, DataType.UNSIGNED32, 10000, 'ro');
const torque = add(0x6077, DataType.INTEGER16, 0, 'ro');
const encoder = eds.addEntry(0x608f, { parameterName: 'encoder', objectType: ObjectType.RECORD });
encoder.addSubObject(1, { parameterName: 'increments', dataType: DataType.UNSIGNED32 }).value = 20000;

eds.setSyncCobId(0x80);
eds.setEmcyCobId(0x80 + NODE);
eds.addSdoServerParameter(0, 0x580 + NODE, 0x600 + NODE);
eds.addReceivePdo({ cobId: 0x200 + NODE, transmissionType: 1, dataObjects: [control, target] });
eds.addTransmitPdo({ cobId: 0x180 + NODE, transmissionType: 1, dataObjects: [status, torque, position] });
eds.addTransmitPdo({ cobId: 0x280 + NODE, transmissionType: 2, dataObjects: [shown, error] });

// The states of CiA 402 that the controlword asks for, in few words; no fault.
const STATES = { off: 0x0250, ready: 0x0231, on: 0x0233, enabled: 0x0237 };
let state = 'off';

function obey() {
    const word = control.value & 0x8f;
    if (!(word & 0x02)) state = 'off';
    else if (word === 0x06) state = 'ready';
    else if (word === 0x07) state = state === 'off' ? 'off' : 'on';
    else if (word === 0x0f) state = state === 'on' || state === 'enabled' ? 'enabled' : state;
    status.value = STATES[state];
    shown.value = mode.value;
    torque.value = state === 'enabled' ? target.value : 0;
    position.value += 1;
}

device.on('message', (message) => send(message.id, message.data));

function hears(id, data) {
    device.receive({ id, data, len: data.length });
    if (id === 0x80) obey();
}

const server = net.createServer((client) => {
    let text = '';
    client.setNoDelay(true);
    client.on('error', () => clients.delete(client));
    client.on('close', () => clients.delete(client));
    client.on('data', (more) => {
        text += more.toString('ascii');
        for (let end = text.indexOf('>'); end >= 0; end = text.indexOf('>')) {
            const words = text.slice(text.indexOf('<') + 1, end).trim().split(/\s+/);
            text = text.slice(end + 1);
            if (words[0] === 'open') client.write('< ok >');
            else if (words[0] === 'rawmode') {
                client.write('< ok >');
                setTimeout(() => clients.add(client), QUIET);
            } else if (words[0] === 'send') {
                const id = parseInt(words[1], 16);
                const data = Buffer.from(words.slice(3).map((octet) => parseInt(octet, 16)));
                send(id, data, client);
                hears(id, data);
            }
        }
    });
    client.write('< hi >');
});

device.start();
server.listen(0, '127.0.0.1', () => console.log(server.address().port));
process.stdin.on('end', () => process.exit(0));
process.stdin.resume();
