// Sparkplug B by the library of Eclipse Tahu, as sparkplug.sh calls it. Usage:
//     sparkplug.mjs edge [HOST:]PORT GROUP NODE CSV [BDSEQ]   an edge node with the devices V1 and V2
//     sparkplug.mjs encode JSON                a payload, to stdout
//     sparkplug.mjs decode                     lines "TOPIC HEX" as "TOPIC NAME=VALUE ..."
// An edge node tells changed values once a second, and follows lines of stdin: gap, quiet,
// go, death DEVICE, birth DEVICE. It prints "rebirth" when it is asked for one, and ends
// when its broker is gone. PLANT_RATE is its rows a second, as of plant_server.mjs.
import {readFileSync} from 'node:fs';
import net from 'node:net';
import {createInterface} from 'node:readline';

import library from 'sparkplug-payload';

const {decodePayload, encodePayload} = library.get('spBv1.0');
const [verb, ...args] = process.argv.slice(2);

function decode() {
  const next = {};  // The sequence number of each node.
  createInterface({input: process.stdin}).on('line', line => {
    const [topic, hex] = line.split(' ');
    const [, , type, node] = topic.split('/');
    const {metrics, seq} = decodePayload(Buffer.from(hex, 'hex'));
    if (type === 'NBIRTH') next[node] = 0;
    if (seq !== undefined && Number(seq) !== next[node]) console.log(`WRONG seq ${seq} not ${next[node]}`);
    if (seq !== undefined) next[node] = (next[node] + 1) % 256;
    console.log([topic, ...metrics.map(({name, value}) => `${name}=${value}`)].join(' '));
  });
}

function edge(address, group, node, csv, number = 5) {
  const rows = readFileSync(csv, 'utf8').trim().split('\n').slice(1).map(row => row.split(','));
  // Columns of the file by the names of metrics; V2 lacks its position.
  const columns = {OP: 1, P1: 2, P2: 3, T1: 4, ZT: 5, FT: 6};
  const devices = {V1: Object.keys(columns), V2: Object.keys(columns).filter(name => name !== 'ZT')};
  const aliasOf = (device, name) => 10 * (device === 'V1' ? 1 : 2) + columns[name];
  const bdSeq = {name: 'bdSeq', type: 'UInt64', value: Number(number)};
  let seq = 0, quiet = false, told = {};
  // Rows are a second apart in the time of its clock, and the last one is of now.
  const rate = Number(process.env.PLANT_RATE ?? 1), beganMs = Number(process.env.PLANT_BEGAN_MS ?? Date.now());
  const sinceMs = () => rate * (Date.now() - beganMs);
  const present = () => rows[Math.floor(sinceMs() / 1000) % rows.length];
  const clock = () => Math.round(beganMs - 1000 * (rows.length - rows.length / rate) + sinceMs());

  // Packets of MQTT 3.1.1: type, length in groups of 7 bits, body.
  const [port, host = '127.0.0.1'] = address.split(':').reverse();
  const socket = net.connect(port, host);
  socket.on('error', () => process.exit(3)).on('close', () => process.exit(3));
  const text = value => {
    const bytes = Buffer.from(value);
    return Buffer.concat([Buffer.from([bytes.length >> 8, bytes.length & 255]), bytes]);
  };
  const send = (type, ...parts) => {
    const body = Buffer.concat(parts);
    const length = [];
    for (let n = body.length; length.length === 0 || n > 0; n >>= 7) length.push(n & 127 | (n > 127 ? 128 : 0));
    socket.write(Buffer.concat([Buffer.from([type, ...length]), body]));
  };
  const topic = (type, device) => [`spBv1.0/${group}/${type}/${node}`, ...device ? [device] : []].join('/');
  const publish = (type, device, metrics) => {
    const timestamp = clock();
    const payload = encodePayload({timestamp, seq: seq++ % 256,
      metrics: metrics.map(metric => ({timestamp, ...metric}))});
    send(0x30, text(topic(type, device)), Buffer.from(payload));
  };
  const metricsOf = (device, names, row, birth) => names.map(name => ({alias: aliasOf(device, name),
    type: 'Double', value: Number(row[columns[name]]), ...birth ? {name: `${device}.${name}`} : {}}));
  const bear = device => publish('DBIRTH', device, metricsOf(device, devices[device], present(), true));
  const births = () => {
    seq = 0;
    publish('NBIRTH', '', [bdSeq, {name: 'Node Control/Rebirth', type: 'Boolean', value: false}]);
    for (const device in devices) bear(device);
  };
  const will = encodePayload({timestamp: clock(), metrics: [bdSeq]});
  const keepAliveS = 5;
  send(0x10, text('MQTT'), Buffer.from([4, 0x06, 0, keepAliveS]), text(node), text(topic('NDEATH')),
    Buffer.from([will.length >> 8, will.length & 255]), Buffer.from(will));
  send(0x82, Buffer.from([0, 1]), text(topic('NCMD')), Buffer.from([0]));
  let answered = true;
  setInterval(() => {
    if (!answered) process.exit(3);
    answered = false;
    send(0xc0);
  }, 1000 * keepAliveS);
  socket.on('data', data => {
    answered = true;
    for (let at = 0; at < data.length; at += 2 + data[at + 1])  // Its packets are short.
      if (data[at] === 0x30) {
        console.log('rebirth');
        births();
      }
  });
  births();
  createInterface({input: process.stdin}).on('line', line => {
    const [word, device] = line.split(' ');
    if (word === 'gap') ++seq;
    if (word === 'quiet' || word === 'go') quiet = word === 'quiet';
    if (word === 'death') publish('DDEATH', device, []);
    if (word === 'birth') bear(device);
    if (word === 'death' || word === 'birth') devices[device].dead = word === 'death';
  });
  setInterval(() => {
    if (quiet) return;
    const row = present();
    for (const [device, names] of Object.entries(devices)) {
      const changed = names.filter(name => told[device + name] !== row[columns[name]]);
      for (const name of changed) told[device + name] = row[columns[name]];
      if (changed.length > 0 && !names.dead) publish('DDATA', device, metricsOf(device, changed, row));
    }
  }, 1000 / rate);
}

({decode, edge, encode: json => process.stdout.write(encodePayload(JSON.parse(json)))})[verb](...args);
