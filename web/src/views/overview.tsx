import type { Connection } from "../connection.ts";

export function Overview({ connection }: { connection: Connection }) {
  return <p>{connection.state.value}</p>;
}
