import assert from "node:assert/strict";
import { mock, test } from "node:test";
import { Connection, STATUS_SILENCE } from "../src/connection.ts";

/** WebSocket that the test drives. */
class FakeSocket {
  static readonly OPEN = 1;
  static all: FakeSocket[] = [];
  readyState = 1;
  closed = false;
  sent: { op: string; run?: string | null }[] = [];
  onmessage: ((event: { data: string }) => void) | null = null;
  onclose: (() => void) | null = null;

  constructor() {
    FakeSocket.all.push(this);
  }

  send(text: string): void {
    this.sent.push(JSON.parse(text));
  }

  close(): void {
    this.closed = true;
  }

  receive(message: object): void {
    this.onmessage?.({ data: JSON.stringify(message) });
  }
}

/** Answers of the server by path. */
const answers = new Map<string, () => Response>();

async function connected() {
  FakeSocket.all = [];
  answers.clear();
  answers.set("/api/session", () => Response.json({ role: "operator", share: "arm" }));
  answers.set("/login", () => new Response(null, { status: 204 }));
  const globals = {
    WebSocket: FakeSocket,
    fetch: async (path: string) => answers.get(path)!(),
    location: { hash: "", protocol: "http:", host: "localhost" },
  };
  for (const [name, value] of Object.entries(globals)) {
    Object.defineProperty(globalThis, name, { value, configurable: true });
  }
  const connection = new Connection();
  await connection.start();
  const socket = FakeSocket.all[0]!;
  socket.receive({ op: "hello", run: "first", role: "operator" });
  return { connection, socket };
}

test("an expired session keeps the page and its stop while the socket is open", async (context) => {
  context.mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  const { connection, socket } = await connected();
  const error = { kind: "Refused", message: "no valid session", hint: "" };
  answers.set("/api/call", () => Response.json({ error }, { status: 401 }));
  await assert.rejects(connection.call("devices"), /no valid session/);
  assert.equal(connection.state.value, "open");
  assert.equal(connection.stop(), true);
  assert.deepEqual(socket.sent.at(-1), { op: "stop" });
});

test("values without new statuses count as old", async (context) => {
  context.mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  const { connection, socket } = await connected();
  const start = performance.now();
  let passed = 0;
  const clock = mock.method(performance, "now", () => start + passed);
  socket.receive({ op: "status", state: "running", axes: [] });
  assert.equal(connection.running.value, true);
  for (; passed <= STATUS_SILENCE; passed += 1000) {
    socket.receive({ op: "pong", t: 0 });
    context.mock.timers.tick(1000);
  }
  context.mock.timers.tick(1000);
  assert.equal(connection.fresh.value, false);
  socket.receive({ op: "status", state: "running", axes: [] });
  assert.equal(connection.fresh.value, true);
  clock.mock.restore();
});

test("a request for a state names the run whose axes the page shows", async (context) => {
  context.mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  const { connection, socket } = await connected();
  connection.request([0], "enable");
  assert.equal(socket.sent.at(-1)?.run, "first");
});

test("a second login closes the former socket", async (context) => {
  context.mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  const { connection, socket } = await connected();
  await connection.login("token");
  assert.equal(socket.closed, true);
  assert.equal(FakeSocket.all.length, 2);
});

test("an answer that breaks off is tried again", async (context) => {
  context.mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  const { connection, socket } = await connected();
  const session = answers.get("/api/session")!;
  answers.set("/api/session", () => new Response('{"role": "oper'));
  socket.onclose?.();
  assert.equal(connection.state.value, "lost");
  context.mock.timers.tick(100);
  for (let turn = 0; turn < 20; turn++) await Promise.resolve();
  await new Promise(setImmediate);
  answers.set("/api/session", session);
  context.mock.timers.tick(200);
  await new Promise(setImmediate);
  assert.equal(FakeSocket.all.length, 2);
});
