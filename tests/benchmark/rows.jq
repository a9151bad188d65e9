# From Google Benchmark's JSON to the rows of out/benchmark/ratios.json. $table: rows.json.
#
# A row of the table: `of`: the benchmarks whose greatest value it is (least, if `better` is "more");
# `counter`: the counter that holds it; `baseline`: the row that it is compared with, where both have
# `per` by one of what that counter counts; `bar`: least ratio; `at_most`, `at_least`: bars for the
# value itself; `slow`: left out of quick runs. Rows whose benchmarks did not run, or failed, are left
# out.

# How many of a counter's units make one of a row's.
def scale: {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9, "M/s": 1e6, "B": 1, "MB": 1e6}[.]
  // error("the unit \(.) is not known");
# "name/manual_time" and the like without what Google Benchmark adds.
def plain: sub("(/(manual_time|real_time|process_time|iterations:[0-9]+|min_time:[0-9.]+))+$"; "");
def counter($name): if has($name) then .[$name] else error("\(.name) has no counter \($name)") end;

(reduce (.benchmarks[] | select(.error_occurred != true)) as $run
  ({}; .[$run.name | plain] = $run)) as $runs
| [$table[]
   | . as $row
   | [.of[] | $runs[.] | select(. != null)] as $of
   | select($of | length == ($row.of | length))
   | .raw = ([$of[] | counter($row.counter)] | if $row.better == "more" then min else max end)
   | .each = .raw / (if .per then $of[0] | counter($row.per) else 1 end)
  ]
| (map({key: .name, value: .}) | from_entries) as $measured
| map(
    . as $row
    | (if .baseline then $measured[.baseline] else null end) as $base
    | (if $base == null then null
       elif .better == "more" then .each / $base.each
       else $base.each / .each end) as $ratio
    | (.raw / (.unit | scale)) as $value
    | [if .bar then {text: "ratio >= \(.bar)", met: ($ratio != null and $ratio >= $row.bar)}
       else empty end,
       if .at_most then {text: "value <= \(.at_most)", met: ($value <= $row.at_most)}
       else empty end,
       if .at_least then {text: "value >= \(.at_least)", met: ($value >= $row.at_least)}
       else empty end] as $bars
    | {name, value: $value, unit, baseline: ($base.name // null), ratio: $ratio, what,
       bar: (if $bars == [] then null else $bars | map(.text) | join(", ") end),
       met: (if $bars == [] then null else $bars | all(.met) end)})
