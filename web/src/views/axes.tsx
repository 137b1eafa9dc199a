import type { Connection } from "../connection.ts";

export function Axes({ connection }: { connection: Connection }) {
  return <p>{connection.state.value}</p>;
}
