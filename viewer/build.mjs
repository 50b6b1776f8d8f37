// Builds the page's template from src/ into the package: node build.mjs [OUT_DIR]
import asc from "assemblyscript/asc";
import { build } from "esbuild";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, "../src/ddf/io/viewer");
const common = { bundle: true, minify: true, write: false, target: "es2022", charset: "utf8", legalComments: "none" };

async function text(file, options = {}) {
  const built = await build({ ...common, ...options, entryPoints: [join(here, "src", file)] });
  return built.outputFiles[0].text.trim().replaceAll("</script", "<\\/script");
}

/** The wasm of `kernels/network.ts`, base64. */
async function kernels() {
  let wasm;
  const how = ["-O3", "--runtime", "stub", "--enable", "simd", "--noAssert", "--outFile", "network.wasm"];
  const { error, stderr } = await asc.main([join(here, "kernels/network.ts"), "--baseDir", "/", ...how], { writeFile: (_, data) => (wasm = data) });
  if (error) throw new Error(`${error}: ${stderr}`);
  return Buffer.from(wasm).toString("base64");
}

await mkdir(out, { recursive: true });
const page = await readFile(join(here, "src/page.html"), "utf8");
const parts = { "/*style*/": await text("style.css"), "/*script*/": await text("main.ts", { format: "iife", define: { KERNELS: JSON.stringify(await kernels()) } }) };
await writeFile(join(out, "page.html"), page.replace(/\/\*\w+\*\//g, (mark) => parts[mark] ?? mark));
