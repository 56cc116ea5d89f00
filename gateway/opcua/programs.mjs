// The programs that the OPC UA server stands on: `fdi-gateway out --lines` tells
// it of the valves, and `fdi-store` writes down what operators do.
import {execFile, spawn} from 'node:child_process';
import {createInterface} from 'node:readline';

const silenceMs = 5000;  // The gateway prints a line each second.
const pausesMs = [1000, 2000, 5000, 10_000];

// Where states come from, in one place: calls onState(state) for each valve
// that is told anew, and onSilence(why) when nothing that was told counts any
// more. A gateway that ends or stands still is started again, and then tells of
// all valves. @returns a function that ends it.
export function followStates(options, {onState, onSilence, say}) {
  let child, restart, ended = false, failures = 0;
  const start = () => {
    child = spawn(process.env.FDI_GATEWAY ?? 'fdi-gateway',
      ['out', '--lines', '-', ...options], {stdio: ['ignore', 'pipe', 'inherit']});
    const own = child;
    let watchdog;
    const stop = why => {
      clearTimeout(watchdog);
      if (own !== child) return;
      child = null;
      own.kill('SIGKILL');
      if (ended) return;
      onSilence(why);
      say(why);
      restart = setTimeout(start, pausesMs[Math.min(failures++, pausesMs.length - 1)]);
    };
    const heard = () => {
      clearTimeout(watchdog);
      watchdog = setTimeout(stop, silenceMs, `fdi-gateway is silent for ${silenceMs / 1000} s`);
    };
    heard();
    own.on('error', error => stop(`fdi-gateway does not start: ${error.message}`));
    own.on('exit', (code, signal) => stop(`fdi-gateway ended with ${signal ?? code}`));
    createInterface({input: own.stdout}).on('line', line => {
      if (own !== child) return;
      heard();
      let message;
      try {
        message = JSON.parse(line);
      } catch {
        return say(`fdi-gateway printed what is no JSON: ${line.slice(0, 80)}`);
      }
      if (typeof message?.topic !== 'string' || !message.topic.endsWith('/state')) return;
      if (typeof message.payload?.valve_id !== 'string') return say('a state without valve_id');
      failures = 0;
      onState(message.payload);
    });
  };
  start();
  return () => {
    ended = true;
    clearTimeout(restart);
    child?.kill('SIGTERM');
  };
}

// @returns null, or the exit code and what it said. Texts of clients are values
// of options, whatever they begin with.
export function store(...args) {
  return new Promise(resolve => {
    execFile(process.env.FDI_STORE ?? 'fdi-store', args, {timeout: 10_000},
      (error, stdout, stderr) => resolve(error &&
        {code: error.code, text: stderr.trim().split('\n').pop() || error.message}));
  });
}
