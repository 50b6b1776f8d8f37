// Builds the page's template from src/ into the package: node build.mjs [OUT_DIR]
import { build } from "esbuild";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, "../src/ddf/export/viewer");
const common = { bundle: true, minify: true, write: false, target: "es2022", charset: "utf8", legalComments: "none" };

async function text(file, options = {}) {
  const built = await build({ ...common, ...options, entryPoints: [join(here, "src", file)] });
  return built.outputFiles[0].text.trim().replaceAll("</script", "<\\/script");
}

await mkdir(out, { recursive: true });
const page = await readFile(join(here, "src/page.html"), "utf8");
const parts = { "/*style*/": await text("style.css"), "/*script*/": await text("main.ts", { format: "iife" }) };
await writeFile(join(out, "page.html"), page.replace(/\/\*\w+\*\//g, (mark) => parts[mark] ?? mark));
