# From Google Benchmark's JSON to the rows of out/benchmark/ratios.json. $table: rows.json.
#
# A row of the table: `of`: the benchmarks whose greatest value it is (least, if `better` is "more");
# `counter`: the counter that holds it; `baseline`: the row that it is compared with; `bar`: least
# ratio; `at_most`, `at_least`: bars for the value itself. Rows whose benchmarks did not run, or
# failed, are left out.

# How many of a counter's units make one of a row's.
def scale: {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9, "M/s": 1e6, "MB": 1e6}[.]
  // error("the unit \(.) is not known");
# "name/manual_time" and the like without what Google Benchmark adds.
def plain: sub("(/(manual_time|real_time|process_time|iterations:[0-9]+|min_time:[0-9.]+))+$"; "");

(reduce (.benchmarks[] | select(.error_occurred != true)) as $run
  ({}; .[$run.name | plain] = $run)) as $runs
| [$table[]
   | . as $row
   | [.of[] | $runs[.] | select(. != null) | .[$row.counter]
      // error("\(.name) has no counter \($row.counter)")] as $values
   | select($values | length == ($row.of | length))
   | .raw = (if .better == "more" then $values | min else $values | max end)
  ]
| (map({key: .name, value: .}) | from_entries) as $measured
| map(
    . as $row
    | (if .baseline then $measured[.baseline] else null end) as $base
    | (if $base == null then null
       elif .better == "more" then .raw / $base.raw
       else $base.raw / .raw end) as $ratio
    | (.raw / (.unit | scale)) as $value
    | {name, value: $value, unit, baseline: ($base.name // null), ratio: $ratio, what,
       bar: (if .bar then "ratio >= \(.bar)"
             elif .at_most then "value <= \(.at_most)"
             elif .at_least then "value >= \(.at_least)"
             else null end),
       met: (if .bar then (if $ratio == null then null else $ratio >= $row.bar end)
             elif .at_most then $value <= $row.at_most
             elif .at_least then $value >= $row.at_least
             else null end)})
