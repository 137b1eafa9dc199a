import type { Connection } from "../connection.ts";

export function Devices({ connection }: { connection: Connection }) {
  return <p>{connection.state.value}</p>;
}
