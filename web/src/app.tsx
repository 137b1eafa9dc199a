/** Entry point of the operator's page. */

import "./app.css";
import { render } from "preact";
import { Connection } from "./connection.ts";
import { Shell } from "./shell.tsx";
import { applyTheme } from "./theme.ts";

const connection = new Connection();
const root = document.getElementById("app");
applyTheme();
if (root !== null) render(<Shell connection={connection} />, root);
void connection.start();
